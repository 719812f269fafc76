"""The references i(v) against geometry that is known."""

from dataclasses import replace

import numpy as np
import pytest

from r2sego_blender.config.settings import SelectionSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GenerationError
from r2sego_blender.views.references import select_reference, with_references
from r2sego_blender.views.selection import select_targets

LENS = Camera(64, 48, 40.0, 40.0, 32.0, 24.0, np.eye(4))


def wall_with_screen(camera):
    """Depth of the wall y = 3; from x < 0 a screen at y = 1 hides its half x > 0."""
    rays = camera.rays() @ camera.world_from_camera[:3, :3].T
    wall = (3.0 - camera.centre[1]) / rays[..., 1]
    screen = (1.0 - camera.centre[1]) / rays[..., 1]
    hit = camera.centre + rays * screen[..., None]
    hidden = (screen > 0) & (hit[..., 0] > -1.0) & (hit[..., 0] < 0.0)
    return np.where(hidden, screen, wall).astype(np.float32)


def test_the_reference_sees_the_most_and_occlusion_counts():
    settings = SelectionSettings(overlap_scale=0.5)
    target = LENS.at(look_at([1.5, 0.0, 1.0], [1.5, 3.0, 1.0]))
    captures = [
        LENS.at(look_at([-1.5, 0.0, 1.0], [1.5, 3.0, 1.0])),  # looks at the wall, behind the screen
        LENS.at(look_at([1.2, -0.5, 1.0], [1.5, 3.0, 1.0])),  # sees it all
        LENS.at(look_at([1.5, 0.0, 1.0], [1.5, -3.0, 1.0])),  # looks away
    ]
    depths = [wall_with_screen(camera) for camera in captures]
    index, overlaps = select_reference(target, captures, wall_with_screen, depths, settings)
    assert index == 1
    assert overlaps[1] > 0.95
    assert overlaps[2] == 0.0
    free, unhidden = select_reference(
        target, captures[:1], wall_with_screen, [np.full(LENS.shape, 50.0, np.float32)], settings
    )
    assert free == 0
    assert overlaps[0] < unhidden[0] - 0.1


def test_a_target_at_a_capture_overlaps_it_wholly():
    camera = LENS.at(look_at([1.5, 0.0, 1.0], [1.5, 3.0, 1.0]))
    _, overlaps = select_reference(
        camera, [camera], wall_with_screen, [wall_with_screen(camera)], SelectionSettings(overlap_scale=1.0)
    )
    assert overlaps.tolist() == [1.0]


@pytest.mark.parametrize("size", [(64, 48), (16, 12)])
def test_a_point_is_seen_unless_the_captures_depth_there_is_nearer_or_unknown(size):
    """One wall, and a capture at the target's pose whose depth is of blocks, also of a smaller image."""
    camera = LENS.at(look_at([0.0, 0.0, 1.0], [0.0, 2.0, 1.0]))
    blocks = np.random.default_rng(0).choice([0.0, 1.0, 2.0, 5.0], (12, 16)).astype(np.float32)
    depth = blocks.repeat(size[1] // 12, axis=0).repeat(size[0] // 16, axis=1)
    _, overlaps = select_reference(
        camera, [camera], lambda c: np.full(c.shape, 2.0, np.float32), [depth], SelectionSettings(overlap_scale=1)
    )
    assert overlaps[0] == (blocks >= 2.0).mean()


@pytest.mark.parametrize(
    ("nearer_m", "tolerance", "seen"), [(0.05, 0.03, 1.0), (0.05, 0.015, 0.0), (0.008, 0.001, 1.0), (0.015, 0.001, 0.0)]
)
def test_depth_may_differ_by_the_tolerance_and_a_centimetre(nearer_m, tolerance, seen):
    camera = LENS.at(look_at([0.0, 0.0, 1.0], [0.0, 2.0, 1.0]))
    settings = SelectionSettings(overlap_scale=0.25, overlap_tolerance=tolerance)
    depth = np.full(camera.shape, 2.0 - nearer_m, np.float32)
    _, overlaps = select_reference(camera, [camera], lambda c: np.full(c.shape, 2.0, np.float32), [depth], settings)
    assert overlaps.tolist() == [seen]


def test_no_captures_are_an_error():
    with pytest.raises(GenerationError, match="no captures"):
        select_reference(LENS, [], wall_with_screen, [], SelectionSettings())


def test_only_the_best_get_references():
    settings = SelectionSettings(overlap_scale=0.5, target_views=1)
    ahead = LENS.at(look_at([1.5, 0.0, 1.0], [1.5, 3.0, 1.0]))
    aside = LENS.at(look_at([-2.0, 0.0, 1.0], [-2.0, 3.0, 1.0]))
    selection = select_targets([0.9, 0.5, 0.4], np.ones(3), [0, 1, 2], np.zeros(3), settings)
    referred = with_references(selection, [aside, ahead, ahead], [ahead, aside], wall_with_screen, settings, 2)
    assert referred.reference.tolist() == [1, 0, -1]
    assert referred.overlaps[0, 1] == referred.overlaps[1, 0] == 1.0
    assert not referred.overlaps[2].any()
    assert replace(referred, reference=selection.reference, overlaps=selection.overlaps) == selection

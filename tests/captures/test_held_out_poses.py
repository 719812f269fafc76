"""Held-out photographs are put where the captures say they were taken, and only where the given poses are wrong."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cameras_file import save_cameras_json
from disturbed_poses import with_disturbed_poses

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.held_out_poses import adjusted_views
from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import look_at, rotation_angle_rad
from r2sego_blender.core.images import save_image
from r2sego_blender.evaluation.frozen_views import frozen_views
from r2sego_blender.refine.creation import create_scene

SETTINGS = CaptureSettings(max_features=1500)


@pytest.fixture(scope="module")
def views(room, room_cameras, tmp_path_factory):
    """Three held-out photographs between the captures, at their true poses."""
    folder = tmp_path_factory.mktemp("held_out")
    made = []
    for index, place in enumerate([(-0.6, -2.3, 1.5), (0.1, -2.3, 1.5), (0.8, -2.1, 1.55)]):
        camera = room_cameras[0].at(look_at(place, (0.2, 0.6, 0.6)))
        path = folder / f"held_out{index}.png"
        save_image(path, room.image(camera))
        made.append(Capture(path.name, path, camera))
    return made


def _disturbed(captures, seed):
    return with_disturbed_poses(captures, np.random.default_rng(seed))


def _off(views, true):
    """Degrees and metres that views are off, the most of them."""
    pairs = [(a.camera, b.camera) for a, b in zip(views, true, strict=True)]
    turned = max(np.degrees(rotation_angle_rad(a.world_from_camera, b.world_from_camera)) for a, b in pairs)
    return turned, max(np.linalg.norm(a.centre - b.centre) for a, b in pairs)


def test_wrong_poses_are_put_right_and_it_is_told(views, room_captures):
    found, told = adjusted_views(_disturbed(views, 3), room_captures, SETTINGS)
    turned_deg, moved_m = _off(found, views)
    assert turned_deg < 0.06 and moved_m < 0.005
    assert told.startswith("poses refined from ") and "moved by 1.0 cm" in told


def test_right_poses_are_kept_to_the_bit_and_nothing_is_told(views, room_captures):
    found, told = adjusted_views(views, room_captures, SETTINGS)
    assert not told
    for view, given in zip(found, views, strict=True):
        assert np.array_equal(view.camera.world_from_camera, given.camera.world_from_camera)


def test_poses_are_never_touched_where_that_was_asked(views, room_captures):
    wrong = _disturbed(views, 3)
    assert adjusted_views(wrong, room_captures, replace(SETTINGS, refine_poses="never")) == (tuple(wrong), "")


def test_how_a_photograph_was_exposed_does_not_matter(views, room_captures, tmp_path):
    """Its features' pixels alone are looked at: half as bright it is found where it is as it was."""
    wrong, darker = _disturbed(views, 3), []
    for view in wrong:
        save_image(tmp_path / view.name, 0.5 * view.image())
        darker.append(replace(view, image_path=tmp_path / view.name))
    turned_deg, moved_m = _off(adjusted_views(darker, room_captures, SETTINGS)[0], views)
    assert turned_deg < 0.06 and moved_m < 0.005


def test_a_view_that_shares_nothing_stays_where_it_was_given(views, room_captures, tmp_path):
    save_image(tmp_path / "grey.png", np.full((300, 400, 3), 0.5, np.float32))
    wrong = _disturbed(views, 3)
    wrong[1] = replace(wrong[1], image_path=tmp_path / "grey.png")
    found, told = adjusted_views(wrong, room_captures, SETTINGS)
    assert told and np.array_equal(found[1].camera.world_from_camera, wrong[1].camera.world_from_camera)
    assert _off([found[0], found[2]], [views[0], views[2]])[0] < 0.06
    alone, told = adjusted_views(wrong[1:2], room_captures, SETTINGS)
    assert alone == (wrong[1],) and not told


def test_views_of_a_bundle_stand_among_its_refined_captures(views, room_captures, tmp_path):
    """The same tracker gave both: how a view is turned against each capture is what it was in truth."""
    folder, file = room_captures[0].image_path.parent, tmp_path / "cameras.json"
    held_out = [replace(view, image_path=Path(shutil.copy(view.image_path, tmp_path))) for view in _disturbed(views, 3)]
    save_cameras_json(file, _disturbed(room_captures, 5), frozen=held_out, folder=folder)
    scene = create_scene(tmp_path / "room.r2s", folder, file, settings=SETTINGS)
    posed = frozen_views(scene, file)
    assert posed.refined.startswith("poses refined from ")
    captures = scene.read(CAPTURES)
    for view, true in zip(posed.views, views, strict=True):
        for capture, as_taken in zip(captures, room_captures, strict=True):
            between = [
                one.camera.world_from_camera[:3, :3].T @ other.camera.world_from_camera[:3, :3]
                for one, other in ((view, capture), (true, as_taken))
            ]
            assert np.degrees(rotation_angle_rad(*(_pose(turn) for turn in between))) < 0.1


def _pose(rotation):
    pose = np.eye(4)
    pose[:3, :3] = rotation
    return pose

"""The captures' colours on the proxy against exact colours and a plain count."""

from dataclasses import replace

import numpy as np
import pytest
from box_room import arc, lens, psnr, render, texture, write_captures

from r2sego_blender.config.settings import GenerationSettings
from r2sego_blender.core.cameras import look_at
from r2sego_blender.core.errors import GenerationError
from r2sego_blender.generation.conditions.point_condition import PointConditions

SETTINGS = GenerationSettings()
CORNER = lens().at(look_at([-1.2, -1.4, 1.5], [0.4, 0.9, 0.3]))  # none of the captures' poses


@pytest.fixture(scope="module")
def points(box_room):
    return PointConditions(box_room.captures, box_room.depths, SETTINGS)


def seen_by(condition, captures, depths):
    """(N, H, W) bool: which captures see the point of each pixel, one capture at a time."""
    world, found = condition.camera.unproject(condition.depth), []
    for capture, depth in zip(captures, depths, strict=True):
        pixels, z = capture.camera.project(world)
        inside = capture.camera.sees(pixels, z) & (z > 0.02)
        column, row = (np.where(inside, pixels[..., k], 0).astype(int) for k in range(2))
        found.append(inside & (np.abs(depth[row, column] - z) <= SETTINGS.depth_tolerance * z + 0.01))
    return np.array(found)


def test_visibility_counts_the_captures_that_see_a_point(box_room, points):
    (condition,) = box_room.renderer.render([CORNER])
    expected = seen_by(condition, box_room.captures, box_room.depths).sum(axis=0)
    assert set(np.unique(expected)) >= {0, 1, 4}
    assert np.mean(points.visibility(condition) == expected) > 0.999


def test_points_have_the_colours_of_the_surface_and_are_black_where_none_sees_them(box_room, points):
    (condition,) = box_room.renderer.render([CORNER])
    (frame,) = points.render(1, [condition])
    exact, _ = render(CORNER)
    np.testing.assert_array_equal(frame.known, frame.visibility > 0)
    assert 0.7 < frame.known.mean() < 1.0
    assert psnr(frame.colour[frame.known], exact[frame.known]) > 30.0
    assert not frame.colour[~frame.known].any()


def test_the_reference_colours_a_point_or_else_the_capture_that_shows_it_largest(box_room, tmp_path):
    """Photographs of one grey each, so that a pixel tells its capture, against numpy."""
    greys = np.array([0.2, 0.4, 0.6, 0.8])
    captures, depths = write_captures(tmp_path, arc(4), colour=np.ones_like, gains=greys)
    (condition,) = box_room.renderer.render([CORNER])
    (frame,) = PointConditions(captures, depths, SETTINGS).render(1, [condition])
    world, seen = condition.camera.unproject(condition.depth), seen_by(condition, captures, depths)
    size = np.full(seen.shape, -np.inf)
    for k, capture in enumerate(captures):
        turned = np.abs(((world - capture.camera.centre) * condition.normal).sum(-1))
        z = capture.camera.project(world)[1]
        size[k] = np.where(seen[k], np.inf if k == 1 else turned / np.maximum(z, 1e-3) ** 3, -np.inf)
    expected = size.argmax(axis=0)[frame.known]
    assert set(expected) == {0, 1, 2, 3}
    chosen = np.abs(frame.colour[frame.known][:, :1] - greys).argmin(axis=1)
    assert np.mean(chosen == expected) > 0.995


def test_at_the_references_pose_the_frame_is_its_photograph(box_room, points):
    camera = box_room.captures[2].camera
    frame, half = points.render(2, box_room.renderer.render([camera, camera.scaled(0.5)]))
    photograph = box_room.captures[2].image()
    np.testing.assert_allclose(frame.colour, photograph, atol=1e-6)
    assert frame.known.all()
    np.testing.assert_allclose(half.colour, photograph.reshape(60, 2, 80, 2, 3).mean(axis=(1, 3)), atol=2.0 / 255.0)


def test_a_wider_lens_shows_the_photograph_and_points_around_it(box_room, points):
    reference = box_room.captures[0].camera
    wide = replace(reference, fx=60.0, fy=60.0)
    (frame,) = points.render(0, box_room.renderer.render([wide]))
    exact, _ = render(wide)
    inside = np.zeros(wide.shape, bool)
    inside[25:-25, 35:-35] = True  # 60 of 96 pixels of focal length: the photograph's part
    assert frame.known[inside].all()
    assert psnr(frame.colour[inside], exact[inside]) > 28.0
    assert frame.known[~inside].any()


def test_a_point_keeps_its_colour_as_the_camera_moves(box_room, tmp_path):
    """Photographs of different brightness: a colour that changed its source would show it."""
    gains = (1.0, 0.8, 0.6, 0.4)
    captures, depths = write_captures(tmp_path, arc(4), gains=gains)
    points = PointConditions(captures, depths, SETTINGS)
    centres = np.linspace([-0.5, -1.2, 1.3], [0.5, -1.2, 1.3], 3)
    path = [lens().at(look_at(centre, [0.0, 0.6, 0.5])) for centre in centres]
    conditions = box_room.renderer.render(path)
    frames = points.render(3, conditions)
    gain = []
    for frame, condition in zip(frames, conditions, strict=True):
        exact = texture(condition.camera.unproject(condition.depth))
        gain.append(np.where(frame.known, frame.colour.sum(-1) / exact.sum(-1), np.nan))
    first, other = (conditions[k].camera.unproject(conditions[k].depth) for k in (0, 2))
    pixels, z = path[2].project(first)
    inside = path[2].sees(pixels, z)
    column, row = (np.where(inside, pixels[..., k], 0).astype(int) for k in range(2))
    same = inside & (np.linalg.norm(other[row, column] - first, axis=-1) < 0.02)
    change = np.abs(gain[2][row, column] - gain[0])[same]
    assert same.mean() > 0.3
    assert np.nanmean(change < 0.1) > 0.97
    by_reference = seen_by(conditions[0], captures, depths)[3]
    assert np.mean(np.abs(gain[0][by_reference] - gains[3]) < 0.05) > 0.97


def test_threads_do_not_matter(box_room, points, with_threads):
    conditions = box_room.renderer.render([CORNER])
    with_one = with_threads(1, lambda: points.render(1, conditions)[0])
    with_all = points.render(1, conditions)[0]
    np.testing.assert_array_equal(with_one.colour, with_all.colour)
    np.testing.assert_array_equal(with_one.visibility, with_all.visibility)


def test_bad_captures_are_refused(box_room):
    with pytest.raises(GenerationError, match="no captures"):
        PointConditions([], [], SETTINGS)
    with pytest.raises(ValueError, match="size"):
        PointConditions(box_room.captures, [depth[:-1] for depth in box_room.depths], SETTINGS)

"""A capture moved to another camera looks as that camera sees it, or says that it knows nothing."""

import numpy as np
import pytest

from r2sego_blender.core.cameras import look_at
from r2sego_blender.generation.registration.capture_surfaces import CaptureSurface


def luminance(image):
    return image @ np.array([0.299, 0.587, 0.114], np.float32)


@pytest.fixture(scope="module")
def surface(box_room):
    return CaptureSurface(box_room.captures[0], box_room.depths[0])


def test_at_its_own_camera_the_photograph_comes_back(box_room, surface):
    own = box_room.captures[0]
    moved = surface.seen_from(own.camera)
    known = moved.depth > 0.0
    assert known.mean() > 0.95
    assert np.quantile(np.abs(moved.grey - luminance(own.image()))[known], 0.99) < 0.02
    assert np.quantile(np.abs(moved.depth / box_room.depths[0] - 1.0)[known], 0.99) < 0.01


def test_from_another_camera_it_looks_like_the_other_photograph(box_room, surface):
    other = box_room.captures[1]
    moved = surface.seen_from(other.camera)
    known = (moved.depth > 0.0) & (np.abs(moved.depth / box_room.depths[1] - 1.0) < 0.02)
    assert known.mean() > 0.5
    assert np.quantile(np.abs(moved.grey - luminance(other.image()))[known], 0.9) < 0.05


def test_from_behind_there_is_nothing(box_room, surface):
    camera = box_room.captures[0].camera
    behind = camera.at(look_at([0.0, 6.0, 1.2], [0.0, 0.0, 1.0]))  # beyond the wall it shows
    assert (surface.seen_from(behind).depth > 0.0).mean() < 0.05


def test_lifted_pixels_are_points_of_the_room_with_their_uncertainty(box_room):
    capture, depth = box_room.captures[0], box_room.depths[0]
    observed = depth.copy()
    observed[:, : capture.camera.width // 2] = 0.0
    surface = CaptureSurface(capture, observed, depth)
    camera = box_room.captures[1].camera
    moved = surface.seen_from(camera)
    rows, columns = np.nonzero(moved.depth > 0.0)
    points, spreads = surface.lift(moved, camera, columns, rows)
    pixels, _ = camera.project(points)
    np.testing.assert_allclose(pixels, np.stack([columns, rows], axis=1) + 0.5, atol=1e-4)
    in_capture, _ = capture.camera.project(points)
    np.testing.assert_allclose(in_capture, moved.pixels[rows, columns], atol=0.05)
    # a spread lies along the capture's ray: it does not move the point in the capture
    np.testing.assert_allclose(capture.camera.project(points + spreads)[0], in_capture, atol=0.05)
    relative = np.linalg.norm(spreads, axis=1) / np.linalg.norm(points - capture.camera.centre, axis=1)
    left = in_capture[:, 0] < capture.camera.width / 2 - 1
    assert relative[left].min() > 2.0 * relative[~left].min() > 0.0


def test_a_capture_without_depth_shows_nothing(box_room):
    capture = box_room.captures[0]
    surface = CaptureSurface(capture, np.zeros(capture.camera.shape, np.float32))
    assert surface.face_count == 0
    assert not surface.seen_from(capture.camera).depth.any()

"""A corrected lens shows what the old one did not, and held-out views of the same lens follow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.lens_correction import brought_along, corrected
from r2sego_blender.captures.lenses.lens import Lens
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import save_image

TERMS = np.array([-0.08, 0.02, -0.015, -0.09, 0.02])
PLAIN = np.array([-0.08, 0.02, -0.015, 0.0, 0.0])


@pytest.fixture
def photograph(tmp_path, rng):
    """800x600, twice the working size."""
    path = tmp_path / "photo.png"
    save_image(path, rng.random((600, 800, 3)).astype(np.float32))
    return path


def _capture(path, lens: Lens | None = None) -> Capture:
    if lens is None:
        return Capture("photo.png", path, Camera(400, 300, 300.0, 300.0, 203.0, 148.0, np.eye(4)))
    return Capture("photo.png", path, lens.straight(np.eye(4)).fitted(400), lens)


def _bent(camera: Camera, rays: np.ndarray, terms: np.ndarray) -> np.ndarray:
    """Where the camera's image shows rays in truth."""
    zoom, right, down, k1, k2 = terms
    squares = (rays**2).sum(axis=1, keepdims=True)
    rays = rays * (1.0 + squares * (k1 + squares * k2)) * np.exp(zoom) + [right, down]
    return rays * [camera.fx, camera.fy] + [camera.cx, camera.cy]


def test_a_focal_length_and_a_centre_change_the_camera_alone(photograph):
    given = _capture(photograph)
    found = corrected(given, PLAIN)
    rays = np.array([[0.1, 0.2], [-0.4, 0.3]])
    shown = rays * [found.camera.fx, found.camera.fy] + [found.camera.cx, found.camera.cy]
    np.testing.assert_allclose(shown, _bent(given.camera, rays, PLAIN))
    assert found.lens is None and found.camera.shape == given.camera.shape
    assert found.given_lens == Lens(800, 600, 600.0, 600.0, 406.0, 296.0)
    again = corrected(found, PLAIN)
    assert again.given_lens == found.given_lens


@pytest.mark.parametrize(
    "lens",
    [
        None,
        Lens(800, 600, 600.0, 610.0, 405.0, 297.0, (0.05, -0.02, 0.001, -0.001)),
        Lens(800, 600, 600.0, 600.0, 405.0, 297.0, (0.02, 0.01), "opencv_fisheye"),
    ],
    ids=["none", "opencv", "fisheye"],
)
def test_a_distortion_is_composed_with_the_given_one(photograph, lens):
    """A ray lies in the photograph where the old straightened image had it, bent."""
    given = _capture(photograph, lens)
    # A shift of the straightened picture is none of a fisheye's.
    terms = TERMS * [1, 0, 0, 1, 1] if lens and lens.model == "opencv_fisheye" else TERMS
    found = corrected(given, terms)
    rays = np.random.default_rng(3).uniform(-0.5, 0.5, (200, 2)) * [1.0, 0.75]
    working = _bent(given.camera, rays, terms)
    truth = given.photograph_shares(working) * given.photograph_size
    off_px = np.linalg.norm(found.lens.project(rays) - truth * 800 / given.photograph_size[0], axis=1)
    assert np.sqrt(np.mean(off_px**2)) < 0.8
    if lens is None:
        np.testing.assert_allclose(off_px, 0.0, atol=1e-9)
    assert found.image().shape[:2] == found.camera.shape
    assert max(found.camera.shape) <= 400


def test_held_out_views_of_the_same_lens_follow_and_others_stay(photograph):
    capture = corrected(_capture(photograph), TERMS)
    view = Capture("held.png", photograph, Camera(800, 600, 600.0, 600.0, 406.0, 296.0, np.eye(4)))
    followed = brought_along(view, [capture])
    assert followed.lens is not None
    rays = np.random.default_rng(3).uniform(-0.4, 0.4, (50, 2))
    np.testing.assert_allclose(followed.lens.project(rays), capture.lens.project(rays), atol=1e-9)
    assert followed.camera.fx == pytest.approx(followed.lens.fx, rel=0.1)
    # one photograph's own, slightly different focal length keeps its difference
    other = replace(view, camera=replace(view.camera, fx=603.0, fy=603.0))
    assert brought_along(other, [capture]).lens.fx == pytest.approx(followed.lens.fx * 603.0 / 600.0)
    far = replace(view, camera=replace(view.camera, fx=660.0, fy=660.0))
    tall = replace(view, camera=Camera(600, 800, 600.0, 600.0, 300.0, 400.0, np.eye(4)))
    bent = replace(view, lens=Lens(800, 600, 600.0, 600.0, 406.0, 296.0, (0.1,)))
    for stranger in (far, tall, bent):
        assert brought_along(stranger, [capture]) is stranger
    assert brought_along(view, [_capture(photograph)]) is view


def test_a_held_out_view_that_was_read_with_the_right_lens_stays(photograph):
    capture = corrected(_capture(photograph), np.array([-0.02, 0.02, -0.015, 0.0, 0.0]))
    right = Camera(800, 600, 2.0 * capture.camera.fx, 2.0 * capture.camera.fy, 418.0, 287.0, np.eye(4))
    view = Capture("held.png", photograph, right)
    assert brought_along(view, [capture]) is view
    wrong = replace(view, camera=replace(right, fx=600.0, fy=600.0, cx=406.0, cy=296.0))
    assert brought_along(wrong, [capture]).camera.fx == pytest.approx(right.fx)


def test_what_the_given_model_cannot_show_is_refused(photograph):
    fisheye = _capture(photograph, Lens(800, 600, 600.0, 600.0, 405.0, 297.0, (0.02, 0.01), "opencv_fisheye"))
    with pytest.raises(CaptureError, match="opencv_fisheye"):
        corrected(fisheye, TERMS)

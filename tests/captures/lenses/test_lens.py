"""Lenses: distortion undone, photographs turned, intrinsics kept."""

from __future__ import annotations

import json
import tracemalloc

import numpy as np
import pytest
from expected_errors import refused
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.lenses.distortion import COEFFICIENTS
from r2sego_blender.captures.lenses.lens import Lens
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import save_image

coefficient = st.floats(-0.12, 0.12)
tangential = st.floats(-0.004, 0.004)
lenses = st.builds(
    lambda k1, k2, p1, p2, cx, cy: Lens(640, 480, 500.0, 520.0, cx, cy, (k1, k2 / 4, p1, p2)),
    coefficient,
    coefficient,
    tangential,
    tangential,
    st.floats(290, 350),
    st.floats(220, 260),
)


@settings(max_examples=40, deadline=None)
@given(lens=lenses, seed=st.integers(0, 999))
def test_rays_and_pixels_are_inverse(lens, seed):
    pixels = np.random.default_rng(seed).uniform([60, 60], [580, 420], (40, 2))
    assert np.abs(lens.project(lens.rays(pixels)) - pixels).max() < 1e-6


def test_fisheye_rays_and_pixels_are_inverse(rng):
    lens = Lens(640, 480, 400.0, 410.0, 318.0, 243.0, (0.03, -0.01, 0.002, 0.0), "opencv_fisheye")
    pixels = rng.uniform([40, 40], [600, 440], (50, 2))
    assert np.abs(lens.project(lens.rays(pixels)) - pixels).max() < 1e-6


@settings(max_examples=30, deadline=None)
@given(lens=lenses, seed=st.integers(0, 999))
def test_working_pixels_agree_with_the_straight_camera(lens, seed):
    camera = lens.straight(np.eye(4))
    assert (camera.fx, camera.fy) == (lens.fx, lens.fy)
    capture = Capture("a", None, camera.fitted(320), lens)
    rays = np.random.default_rng(seed).uniform(-0.35, 0.35, (50, 2))
    points = np.concatenate([rays, np.ones((50, 1))], axis=1) * 3.0
    expected, _ = capture.camera.project(points)
    found = capture.working_pixels(lens.project(rays), (480, 640))
    assert np.abs(found - expected).max() < 0.01


@settings(max_examples=30, deadline=None)
@given(lens=lenses)
def test_a_straight_photograph_has_no_blank_pixels(lens):
    camera = lens.straight(np.eye(4))
    corners = np.array([[0, 0], [camera.width, 0], [0, camera.height], [camera.width, camera.height]])
    edge = np.linspace(0, 1, 20)[:, None]
    border = np.concatenate([corners[i] * (1 - edge) + corners[j] * edge for i, j in ((0, 1), (0, 2), (1, 3), (2, 3))])
    source = lens.project((border - [camera.cx, camera.cy]) / [camera.fx, camera.fy])
    assert source.min() > -0.6
    assert (source < [640.6, 480.6]).all()


def test_a_photograph_without_distortion_keeps_its_numbers():
    lens = Lens(641, 479, 500.0, 517.0, 301.5, 222.25)
    camera = lens.straight(np.eye(4))
    assert (camera.width, camera.height, camera.cx, camera.cy) == (641, 479, 301.5, 222.25)


@settings(max_examples=25, deadline=None)
@given(lens=lenses, turns=st.integers(0, 3))
def test_turning_moves_every_pixel_with_the_photograph(lens, turns):
    rays = np.random.default_rng(turns).uniform(-0.3, 0.3, (20, 2))
    pixels = lens.project(rays)
    turned_rays, height, width = rays, 480, 640
    for _ in range(turns):
        pixels = np.stack([height - pixels[:, 1], pixels[:, 0]], axis=1)
        turned_rays = np.stack([-turned_rays[:, 1], turned_rays[:, 0]], axis=1)
        height, width = width, height
    assert np.abs(lens.turned(turns).project(turned_rays) - pixels).max() < 1e-9


@pytest.mark.parametrize("times", [1, 5])
def test_a_dot_on_a_distorted_photograph_is_straightened_to_its_place(tmp_path, times):
    """Also on a photograph so large that it is scaled down first."""
    lens = Lens(320, 240, 260.0, 270.0, 155.0, 124.0, (-0.25, 0.06, 0.002, -0.001))
    lens = lens.scaled_to(320 * times, 240 * times)
    ray = np.array([[0.41, -0.33]])
    x, y = lens.project(ray)[0]
    columns, rows = np.arange(lens.width) + 0.5, np.arange(lens.height) + 0.5
    dot = np.exp(-((columns[None] - x) ** 2 + (rows[:, None] - y) ** 2) / (18.0 * times**2))
    save_image(tmp_path / "dot.png", np.repeat(dot[..., None], 3, axis=2))
    capture = Capture("dot", tmp_path / "dot.png", lens.straight(np.eye(4)).fitted(320), lens)
    image = capture.image()[..., 0].astype(np.float64) ** 2
    assert image.shape == capture.camera.shape
    centre = [
        (image.sum(axis=0) * (np.arange(image.shape[1]) + 0.5)).sum() / image.sum(),
        (image.sum(axis=1) * (np.arange(image.shape[0]) + 0.5)).sum() / image.sum(),
    ]
    expected, _ = capture.camera.project(np.array([*ray[0], 1.0]))
    # The dot is not round any more, which moves its centroid a little.
    assert np.abs(centre - expected).max() < 0.12


def test_a_phones_large_photograph_is_straightened_in_little_memory():
    lens = Lens(2400, 1800, 2000.0, 2000.0, 1200.0, 900.0, (0.05, -0.02))
    capture = Capture("large", None, lens.straight(np.eye(4)).fitted(320), lens)
    photograph = np.full((1800, 2400, 3), 0.5, np.float32)
    tracemalloc.start()
    try:
        assert capture.seen(photograph).shape == (*capture.camera.shape, 3)
        assert tracemalloc.get_traced_memory()[1] < photograph.nbytes
    finally:
        tracemalloc.stop()


def test_a_distortion_that_folds_is_refused():
    with refused(CaptureError, "camera distortion"):
        Lens(640, 480, 300.0, 300.0, 320.0, 240.0, (-3.0,)).straight(np.eye(4))


@pytest.mark.parametrize("model", COEFFICIENTS)
def test_json_keeps_every_bit(model):
    lens = Lens(640, 480, 500.1, 520.3, 311.7, 244.9, (0.1, -0.07, 0.001), model, border_px=7.5)
    assert Lens.from_json(json.loads(json.dumps(lens.to_json()))) == lens
    with pytest.raises(ValueError, match="no model of a lens"):
        Lens.from_json(lens.to_json() | {"distortion_model": "glass"})


def test_lenses_of_older_bundles_are_read():
    old = {"width": 64, "height": 48, "fx": 50.0, "fy": 50.0, "cx": 32.0, "cy": 24.0, "distortion": [0.1]}
    assert Lens.from_json(old | {"fisheye": True}).model == "opencv_fisheye"
    assert Lens.from_json(old | {"fisheye": False}).model == "opencv"

"""What captures saw is told by hand-counted cases, and each region has the plain PSNR of its pixels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skimage.metrics import peak_signal_noise_ratio
from wall_views import camera, wall

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.evaluation.surfaces.regions import (
    LEAST_PIXELS,
    RegionScore,
    mean_score,
    region_score,
    seen_by,
    seen_by_captures,
)
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer


def test_nothing_behind_a_camera_is_seen():
    one = camera(0.0)
    assert not seen_by(np.array([[0.0, -2.0, 1.0]]), one, wall(one)).any()


def test_what_each_capture_saw_adds_up():
    one, left, right = camera(0.0), camera(-1.5), camera(1.5)
    seen = seen_by_captures(one, wall(one), [left, right], [wall(left), wall(right)])
    assert seen[:, :10].all() and seen[:, 30:].all() and not seen[:, 10:30].any()
    for order in ([left, right], [right, left]):
        np.testing.assert_array_equal(seen_by_captures(one, wall(one), order, [wall(o) for o in order]), seen)
    assert not seen_by_captures(one, wall(one), [], []).any()


def test_a_surface_is_not_seen_through_and_an_opening_is_seen_from_where_one_looks_out_too():
    one = camera(0.0)
    near, opened = wall(one), wall(one)
    near[:, :20] = 1.0
    opened[:, 20:] = 0.0
    assert not seen_by_captures(one, wall(one), [one], [near])[:, :20].any()
    assert seen_by_captures(one, opened, [one], [opened]).all()
    assert not seen_by_captures(one, opened, [one], [near])[:, 20:].any()


@pytest.mark.parametrize(("x", "height"), [(0.0, 0.5), (0.7, 1.6), (-1.0, 0.4)])
def test_a_floor_seen_flatly_is_seen_wherever_it_is_in_the_picture(x, height):
    """Of floor points in both pictures hardly one is lost to the width of a pixel."""
    vertices = np.array([(-9.0, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)])
    room = MeshRasterizer(vertices, np.array([(0, 1, 2), (0, 2, 3)]))
    lens = (640, 480, 480.0, 480.0, 320.0, 240.0)
    one = Camera(*lens, look_at((0.0, -2.0, 1.2), (0.0, 2.0, 0.4)))
    other = Camera(*lens, look_at((x, -2.0, height), (0.0, 2.0, 0.2)))
    depth, other_depth = room.render(one).depth, room.render(other).depth
    pixels, z = other.project(one.unproject(depth))
    inside = (depth > 0.0) & (depth < 5.0) & other.sees(pixels, z, 1.0) & (z < 5.0)
    assert seen_by_captures(one, depth, [other], [other_depth])[inside].mean() > 0.999


@given(st.integers(0, 2**32 - 1), st.integers(0, 24))
def test_a_region_has_the_psnr_of_its_pixels(seed, rows):
    rng = np.random.default_rng(seed)
    image, truth = rng.random((2, 24, 32, 3))
    seen = np.arange(24)[:, None].repeat(32, axis=1) < rows
    found = region_score(image, truth, seen)
    for region, psnr in ((seen, found.psnr_seen), (~seen, found.psnr_unseen)):
        if region.sum() < LEAST_PIXELS:
            assert psnr is None
        else:
            plain = peak_signal_noise_ratio(truth[region], image[region], data_range=1.0)
            assert psnr == pytest.approx(plain, abs=1e-5)
    assert found.unseen == pytest.approx(1.0 - rows / 24)


def test_means_are_of_the_views_that_have_the_region():
    views = [RegionScore(20.0, None, 0.0), RegionScore(24.0, 12.0, 0.5), RegionScore(None, 18.0, 1.0)]
    assert mean_score(views) == RegionScore(22.0, 15.0, 0.5)
    assert mean_score([RegionScore(np.inf, None, 0.0)]).psnr_seen == np.inf

"""Poses from 2D-3D matches against known cameras."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.captures.solving.pnp import estimate_pose
from r2sego_blender.core.cameras import Camera, look_at, rotation_angle_rad

LENS = Camera(640, 480, 381.0, 395.0, 312.0, 251.0, np.eye(4))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), outliers=st.floats(0.0, 0.6))
def test_the_pose_is_found_among_wrong_matches(seed, outliers):
    rng = np.random.default_rng(seed)
    truth = LENS.at(look_at(rng.uniform([-2, -4, 1], [2, -3, 2]), rng.uniform(-0.5, 0.5, 3)))
    points = rng.uniform(-1.5, 1.5, (200, 3))
    pixels, _ = truth.project(points)
    wrong = rng.random(200) < outliers
    pixels[wrong] = rng.uniform([0, 0], [640, 480], (int(wrong.sum()), 2))
    found = estimate_pose(pixels, points, LENS, 2.0, seed=seed)
    assert np.linalg.norm(found.camera.centre - truth.centre) < 1e-3
    assert rotation_angle_rad(found.camera.world_from_camera, truth.world_from_camera) < 1e-3
    assert found.inliers[~wrong].all()
    assert found.inliers[wrong].mean() < 0.1 if wrong.any() else True
    assert (found.camera.fx, found.camera.cy) == (LENS.fx, LENS.cy)


def test_the_same_seed_gives_the_same_bits(rng):
    points = rng.uniform([-1, -1, 3], [1, 1, 5], (60, 3))
    pixels = LENS.project(points)[0] + rng.normal(0, 1, (60, 2))
    first, second = (estimate_pose(pixels, points, LENS, 3.0, seed=5) for _ in range(2))
    assert first.camera.world_from_camera.tobytes() == second.camera.world_from_camera.tobytes()
    assert first.error_px == second.error_px


def test_too_few_or_meaningless_matches_give_no_pose(rng):
    points = rng.uniform([-1, -1, 3], [1, 1, 5], (30, 3))
    pixels = LENS.project(points)[0]
    assert estimate_pose(pixels[:3], points[:3], LENS, 2.0, 0) is None
    assert estimate_pose(np.full((30, 2), np.nan), points, LENS, 2.0, 0) is None
    with pytest.raises(ValueError, match="30 pixels"):
        estimate_pose(pixels, points[:10], LENS, 2.0, 0)


def test_a_match_that_is_not_finite_is_an_outlier(rng):
    points = rng.uniform([-1, -1, 3], [1, 1, 5], (40, 3))
    pixels = LENS.project(points)[0]
    points[7] = np.inf
    found = estimate_pose(pixels, points, LENS, 2.0, 0)
    assert found.inlier_count == 39
    assert not found.inliers[7]

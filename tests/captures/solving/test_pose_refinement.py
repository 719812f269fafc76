"""Refined poses: exact on exact matches, robust, and as certain as they say."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from r2sego_blender.captures.solving.pose_refinement import refine_pose
from r2sego_blender.core.cameras import Camera, look_at, rotation_angle_rad

TRUTH = Camera(640, 480, 381.0, 395.0, 312.0, 251.0, look_at([0.3, -3.0, 1.4], [0.0, 0.0, 0.5]))
OTHER = np.array([1.5, -2.0, 1.6])  # where another capture stood


def moved(camera, rng, offset_m, turn_rad):
    axis, way = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
    pose = camera.world_from_camera.copy()
    pose[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec(turn_rad * axis).as_matrix()
    pose[:3, 3] += offset_m * way
    return camera.at(pose)


def refined(start, pixels, points, spreads=None, focal_px=None, focal_sigma=0.005):
    spreads = np.zeros_like(points) if spreads is None else spreads
    return refine_pose(start, pixels, points, spreads, 1.0, 4.0, focal_px or start.fx, focal_sigma, 80.0)


def offset_m(a, b):
    return np.linalg.norm(a.centre - b.centre)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_exact_matches_give_the_exact_pose(seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (60, 3))
    found = refined(moved(TRUTH, rng, 0.08, 0.06), TRUTH.project(points)[0], points)
    assert offset_m(found.camera, TRUTH) < 1e-6
    assert rotation_angle_rad(found.camera.world_from_camera, TRUTH.world_from_camera) < 1e-6
    assert found.inliers.all()


def test_wrong_matches_hardly_move_the_pose(rng):
    points = rng.uniform(-1, 1, (300, 3))
    pixels = TRUTH.project(points)[0] + rng.normal(0, 0.3, (300, 2))
    wrong = rng.random(300) < 0.2
    pixels[wrong] += rng.uniform(-12, 12, (int(wrong.sum()), 2))
    found = refined(moved(TRUTH, rng, 0.02, 0.01), pixels, points)
    assert offset_m(found.camera, TRUTH) < 0.01
    assert found.inliers[~wrong].all()


def test_the_focal_length_follows_the_frame_where_it_is_seen(rng):
    points = rng.uniform(-1, 1, (400, 3))
    long = Camera(640, 480, TRUTH.fx * 1.04, TRUTH.fy * 1.04, TRUTH.cx, TRUTH.cy, TRUTH.world_from_camera)
    found = refined(TRUTH, long.project(points)[0], points, focal_sigma=0.05)
    assert found.camera.fx == pytest.approx(long.fx, rel=2e-3)
    assert found.camera.fx / found.camera.fy == pytest.approx(TRUTH.fx / TRUTH.fy)
    few = rng.choice(400, 8, replace=False)
    held = refined(TRUTH, long.project(points[few])[0], points[few], focal_sigma=1e-5)
    assert held.camera.fx == pytest.approx(TRUTH.fx, rel=1e-3)


def test_points_uncertain_along_a_line_bind_the_pose_across_it(rng):
    """Depths off by 5 % ruin the pose, unless the matches say along which line they may lie."""
    points = rng.uniform(-1, 1, (200, 3))
    pixels = TRUTH.project(points)[0]
    rays = points - OTHER
    off = points + rays * rng.normal(0, 0.05, (200, 1))
    off[:40] = points[:40]
    spreads = 0.05 * rays
    spreads[:40] *= 0.02
    told = refined(TRUTH, pixels, off, spreads)
    not_told = refined(TRUTH, pixels, off)
    assert offset_m(told.camera, TRUTH) < 0.3 * offset_m(not_told.camera, TRUTH)


def scatter_and_foretold(rng, noise, focal_sigma, repetitions):
    """Metres, along the least certain direction; each match in a cell of its own, said to be off by 1 px."""
    points = rng.uniform(-1, 1, (60, 3))
    exact = TRUTH.project(points)[0]
    centres, foretold = [], []
    for _ in range(repetitions):
        pixels = exact + rng.normal(0, noise, exact.shape)
        focal_px = TRUTH.fx * np.exp(rng.normal(0, focal_sigma))
        found = refine_pose(TRUTH, pixels, points, np.zeros((60, 3)), 1.0, 6.0 * noise, focal_px, focal_sigma, 1e-3)
        centres.append(found.camera.centre)
        foretold.append(found.sigma_m)
    return np.sqrt(np.linalg.eigvalsh(np.cov(np.transpose(centres)))[-1]), np.mean(foretold)


@pytest.mark.parametrize(("focal_sigma", "rel"), [(0.005, 0.25), (1e-6, 0.1)])
def test_the_covariance_is_the_scatter_of_the_estimates(rng, focal_sigma, rel):
    scatter, foretold = scatter_and_foretold(rng, 1.0, focal_sigma, 150)
    assert scatter == pytest.approx(foretold, rel=rel)


def test_matches_that_are_worse_than_they_are_said_to_be_are_found_out(rng):
    """Not wholly: those that are far off count less, in the estimate and in what is foretold of it."""
    scatter, foretold = scatter_and_foretold(rng, 2.0, 1e-6, 80)
    assert 1.0 < scatter / foretold < 1.6


def test_matches_on_one_spot_are_one_match(rng):
    """A thousand matches that share their surface's error do not make the pose certain."""
    points = rng.uniform(-1, 1, (30, 3))
    pixels = TRUTH.project(points)[0]
    once = refined(TRUTH, pixels, points)
    often = refined(TRUTH, np.tile(pixels, (30, 1)), np.tile(points, (30, 1)))
    assert often.sigma_m > 0.9 * once.sigma_m


def test_what_does_not_determine_a_pose_gives_none(rng):
    point = np.tile([[0.1, 0.2, 0.3]], (20, 1))
    found = refined(TRUTH, TRUTH.project(point)[0], point)
    assert found is None or found.sigma_m > 1.0
    assert refined(TRUTH, np.empty((0, 2)), np.empty((0, 3))) is None
    behind = TRUTH.centre - TRUTH.forward + rng.normal(0, 0.1, (20, 3))
    assert refined(TRUTH, rng.uniform(0, 400, (20, 2)), behind) is None

"""Planes through sparse points: fronts and tops that gravity and a few points tell."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.captures.sparse_points import SparsePoints
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.geometry.room.planes import RoomPlanes
from r2sego_blender.geometry.room.sparse_planes import with_sparse_planes

FLOOR = RoomPlanes(np.array([[0.0, 0.0, 1.0]]), np.zeros(1), np.array([100]), np.ones(1, bool))
CAMERAS = tuple(
    Camera(64, 48, 55.4, 55.4, 32.0, 24.0, look_at(np.array([x, -3.0, 1.5]), np.array([0.0, 0.0, 0.8])))
    for x in (-0.5, 0.0, 0.5)
)


def measured(points, error_px=0.2):
    """Sparse points that all three cameras measured."""
    count = len(points)
    return SparsePoints(
        np.asarray(points, np.float64),
        np.zeros((count, 3), np.uint8),
        np.ones((count, 3), bool),
        np.full(count, error_px),
        np.zeros((count, 3, 2), np.float32),
    )


def counter(rng, yaw, noise_m=0.003):
    """Thirty points each of a counter's top at 0.9 m and of its front, which is turned by ``yaw``."""
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    top = np.column_stack([rng.uniform(-0.8, 0.8, 30), rng.uniform(0.02, 0.5, 30), np.full(30, 0.9)])
    front = np.column_stack([rng.uniform(-0.8, 0.8, 30), np.zeros(30), rng.uniform(0.1, 0.88, 30)])
    return np.concatenate([top, front]) @ turn.T + rng.normal(0.0, noise_m, (60, 3))


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 1000), st.floats(-0.6, 0.6))
def test_a_counter_has_a_top_and_a_front(seed, yaw):
    planes = with_sparse_planes(FLOOR, measured(counter(np.random.default_rng(seed), yaw)), CAMERAS)
    added = planes.normals[1:]
    assert not planes.bounding[1:].any() and (planes.inliers[1:] >= 12).all()
    top = np.flatnonzero((added == [0.0, 0.0, 1.0]).all(axis=1))
    assert (np.abs(planes.offsets[1:][top] - 0.9) < 0.03).any()
    towards = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
    assert (np.degrees(np.arccos(np.clip(added @ towards, -1.0, 1.0))) < 8.0).any()


def test_what_a_known_plane_explains_is_no_new_one():
    rng = np.random.default_rng(1)
    carpet = np.column_stack([rng.uniform(-1, 1, 40), rng.uniform(-1, 1, 40), rng.normal(0.0, 0.002, 40)])
    assert with_sparse_planes(FLOOR, measured(carpet), CAMERAS) is FLOOR


@pytest.mark.parametrize("sparse", [SparsePoints.none(3), measured(counter(np.random.default_rng(0), 0.0)[:11])])
def test_few_points_tell_nothing(sparse):
    assert with_sparse_planes(FLOOR, sparse, CAMERAS) is FLOOR


def test_points_of_large_error_tell_nothing():
    assert with_sparse_planes(FLOOR, measured(counter(np.random.default_rng(0), 0.0), 3.0), CAMERAS) is FLOOR


def test_the_same_points_give_the_same_planes():
    sparse = measured(counter(np.random.default_rng(2), 0.3))
    a, b = (with_sparse_planes(FLOOR, sparse, CAMERAS) for _ in range(2))
    assert np.array_equal(a.normals, b.normals) and np.array_equal(a.offsets, b.offsets)

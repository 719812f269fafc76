"""Walls behind which a capture sees recede for it, above what stands before the niche."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.geometry.room.niches import receded
from r2sego_blender.geometry.room.planes import RoomPlanes
from r2sego_blender.geometry.room.point_evidence import PointEvidence

# The wall y = 0 of a corridor, the floor, and a niche behind the wall: a counter 0.9 m high, its back at y = 0.6.
PLANES = RoomPlanes(
    np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]), np.zeros(2), np.array([900, 900]), np.array([True, True])
)
CAMERA = Camera(180, 140, 140.0, 140.0, 90.0, 70.0, look_at(np.array([0.0, -1.5, 1.5]), np.array([0.0, 0.0, 1.1])))
COUNTER_M, BACK_M = 0.9, 0.6


@pytest.fixture
def rng():
    return np.random.default_rng(11)


def in_the_niche(count, rng):
    """Points of its back wall, above the counter."""
    return np.column_stack([rng.uniform(-0.5, 0.5, count), np.full(count, BACK_M), rng.uniform(0.92, 1.7, count)])


def on_the_wall(count, rng):
    return np.column_stack([rng.uniform(-0.5, 0.5, count), np.zeros(count), rng.uniform(0.5, 1.7, count)])


def seen_by_the_camera(points):
    return PointEvidence.of(CAMERA, np.asarray(points).reshape(-1, 3))


@pytest.mark.parametrize("share", [1.0, 0.7])
def test_a_wall_recedes_to_what_lies_behind_it(rng, share):
    count = round(60 * share)
    points = np.concatenate([in_the_niche(count, rng), on_the_wall(60 - count, rng)])
    planes, stays = receded(CAMERA, seen_by_the_camera(points), PLANES)
    np.testing.assert_allclose(planes.envelope.offsets, [0.0, -BACK_M], atol=1e-6)
    np.testing.assert_array_equal(planes.normals[~planes.bounding], PLANES.normals[1:])  # evidence may still choose it
    wall = PLANES.depths(CAMERA)[1]
    height = CAMERA.unproject(wall)[..., 2]
    np.testing.assert_array_equal(stays[height < COUNTER_M - 0.05], wall[height < COUNTER_M - 0.05])
    assert not stays[height > COUNTER_M + 0.15].any()


@pytest.mark.parametrize("kind", ["few behind", "most before", "none", "before"])
def test_a_wall_stays_where_that_is_not_so(rng, kind):
    points = {
        "few behind": in_the_niche(15, rng),
        "most before": np.concatenate([in_the_niche(25, rng), on_the_wall(60, rng)]),
        "none": np.zeros((0, 3)),
        "before": on_the_wall(60, rng) - [0.0, 0.3, 0.0],
    }[kind]
    planes, stays = receded(CAMERA, seen_by_the_camera(points), PLANES)
    assert planes is PLANES and not stays.any()


@given(st.integers(0, 2**32 - 1))
def test_noise_of_a_wall_is_no_niche(seed):
    """5 % of the depth, one sigma: what two photographs a hand apart triangulate."""
    rng = np.random.default_rng(seed)
    points = on_the_wall(80, rng)
    points += (points - CAMERA.centre) * 0.05 * rng.standard_normal((80, 1))
    assert receded(CAMERA, seen_by_the_camera(points), PLANES)[0] is PLANES


def test_the_floor_does_not_recede(rng):
    """Points under it are a mirror's, or wrong."""
    below = np.column_stack([rng.uniform(-0.5, 0.5, 60), np.full(60, 0.3), np.full(60, -0.6)])
    assert receded(CAMERA, seen_by_the_camera(below), PLANES)[0].offsets[0] == 0.0

"""Depth that two captures agree on although it matches badly."""

import dataclasses

import numpy as np
import pytest

from r2sego_blender.config.settings import Settings
from r2sego_blender.geometry.room.completed_depth import DepthSource
from r2sego_blender.geometry.room.completion import complete_depth, trusted_depth
from r2sego_blender.geometry.room.planes import RoomPlanes
from r2sego_blender.geometry.stereo.weak_depth import weak_depth

SETTINGS = Settings()
BAD_MATCH = np.float32(0.9)


def matched_badly(depth_map, where, factor=1.0):
    """The map with its depth times ``factor`` where ``where`` (H, W), matched badly there."""
    return dataclasses.replace(
        depth_map,
        depth=np.where(where, depth_map.depth * factor, depth_map.depth).astype(np.float32),
        cost=np.where(where, BAD_MATCH, depth_map.cost),
        support=np.where(where, 0, depth_map.support).astype(np.uint8),
    )


def weak(maps):
    return weak_depth(maps, trusted_depth(maps, SETTINGS.stereo), SETTINGS.stereo)


@pytest.fixture(scope="module")
def far_wall(room):
    """(H, W) bool for each capture: the upper part of the far wall."""
    seen = [one.camera.unproject(one.depth) for one in room.depth_maps]
    return [(np.abs(points[..., 1] - 1.5) < 1e-3) & (points[..., 2] > 0.9) for points in seen]


def test_depth_that_captures_agree_on_is_taken_at_any_cost(room, far_wall):
    maps = [matched_badly(*one) for one in zip(room.depth_maps, far_wall, strict=True)]
    found = weak(maps)
    for depth, one, wall in zip(found, maps, far_wall, strict=True):
        assert not depth[~wall].any()  # what is trusted is not merely weak
        np.testing.assert_array_equal(depth[depth > 0], one.depth[depth > 0])
    shares = [(depth[wall] > 0).mean() for depth, wall in zip(found, far_wall, strict=True)]
    assert min(shares[1:3]) > 0.9  # the captures in the middle, whose wall others see as well


def test_wrong_depth_is_not_taken(room, far_wall):
    rng = np.random.default_rng(7)
    maps = [
        matched_badly(one, wall, rng.uniform(0.5, 1.5, wall.shape))
        for one, wall in zip(room.depth_maps, far_wall, strict=True)
    ]
    assert max((depth > 0).mean() for depth in weak(maps)) < 0.02


def test_depth_that_a_trusted_one_sees_through_is_not_taken(room, far_wall):
    floating = [matched_badly(one, wall, 0.8) for one, wall in zip(room.depth_maps, far_wall, strict=True)]
    maps = [*floating[:2], *room.depth_maps[2:]]  # two captures agree, two see the wall
    for depth, wall in zip(weak(maps)[:2], far_wall, strict=False):
        assert (depth[wall] > 0).mean() < 0.05


def test_a_speckle_is_not_taken(room, far_wall):
    row, column = np.argwhere(far_wall[1]).mean(0).astype(int)
    speckle = np.zeros(far_wall[1].shape, bool)
    speckle[row : row + 3, column : column + 3] = True
    maps = list(room.depth_maps)
    maps[1] = matched_badly(maps[1], speckle)
    assert speckle.sum() < SETTINGS.stereo.min_segment_share * speckle.size
    assert not weak(maps)[1].any()


def test_weak_depth_completes_what_no_plane_explains(room, far_wall):
    nothing = RoomPlanes(np.zeros((0, 3)), np.zeros(0), np.zeros(0, int), np.zeros(0, bool))
    maps = [matched_badly(*one) for one in zip(room.depth_maps, far_wall, strict=True)]
    completed = complete_depth(room.captures, maps, nothing, SETTINGS)
    for view, truth, wall in list(zip(completed, room.depth_maps, far_wall, strict=True))[1:3]:
        assert (np.abs(view.depth - truth.depth)[wall] < 0.02).mean() > 0.9
        assert (view.source[wall] == DepthSource.PLANE).mean() > 0.9

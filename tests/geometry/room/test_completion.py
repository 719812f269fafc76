"""Completion of depth maps in a room whose true depth is known."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.config.settings import Settings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.room.completed_depth import CompletedDepth, DepthSource
from r2sego_blender.geometry.room.completion import _unopposed, complete_depth, trusted_depth
from r2sego_blender.geometry.room.plane_evidence import homography
from r2sego_blender.geometry.room.planes import RoomPlanes, find_planes

SETTINGS = Settings()


@pytest.fixture(scope="module")
def planes(room, observed_points):
    points, normals = observed_points(noise_m=0.002)
    cameras = tuple(capture.camera for capture in room.captures)
    observed = SimpleNamespace(points=points, normals=normals)
    return find_planes(observed, cameras, SETTINGS.proxy, np.random.default_rng(0))


def with_holes(depth_map, hole):
    """The depth map, wrong and unreliable where ``hole`` (H, W) bool."""
    depth = np.where(hole, depth_map.depth * 0.6, depth_map.depth).astype(np.float32)
    return dataclasses.replace(depth_map, depth=depth, support=np.where(hole, 0, 2).astype(np.uint8))


def relative_error(completed, depth_map):
    return np.abs(completed.depth - depth_map.depth) / depth_map.depth


def test_reliable_depth_is_kept(room, planes):
    for view, truth in zip(
        complete_depth(room.captures, room.depth_maps, planes, SETTINGS), room.depth_maps, strict=True
    ):
        assert (view.source == DepthSource.OBSERVED).mean() > 0.99
        assert (relative_error(view, truth) < 0.01).mean() > 0.98


def test_holes_are_closed_with_the_right_planes(room, planes):
    rng = np.random.default_rng(4)
    maps = []
    for depth_map in room.depth_maps:
        hole = np.zeros(depth_map.depth.shape, bool)
        for _ in range(5):
            y, x = rng.integers(0, 90), rng.integers(0, 120)
            hole[y : y + 30, x : x + 40] = True
        maps.append(with_holes(depth_map, hole))
    for view, truth, given_ in zip(
        complete_depth(room.captures, maps, planes, SETTINGS), room.depth_maps, maps, strict=True
    ):
        hole = given_.support == 0
        assert (view.depth > 0).all()
        assert (relative_error(view, truth)[hole] < 0.03).mean() > 0.87
        assert (view.source[hole] != DepthSource.OBSERVED).all()


def test_a_capture_without_any_depth_is_completed_by_the_others(room, planes):
    maps = list(room.depth_maps)
    maps[1] = with_holes(maps[1], np.ones(maps[1].depth.shape, bool))
    view = complete_depth(room.captures, maps, planes, SETTINGS)[1]
    assert (relative_error(view, room.depth_maps[1]) < 0.03).mean() > 0.85


def test_without_planes_the_nearest_depth_fills(room):
    nothing = RoomPlanes(np.zeros((0, 3)), np.zeros(0), np.zeros(0, int), np.zeros(0, bool))
    hole = np.zeros(room.depth_maps[0].depth.shape, bool)
    hole[:40, :40] = True
    maps = [with_holes(room.depth_maps[0], hole), *room.depth_maps[1:]]
    view = complete_depth(room.captures, maps, nothing, SETTINGS)[0]
    assert (view.depth > 0).all()
    assert set(np.unique(view.source[hole])) <= {DepthSource.PLANE, DepthSource.FILLED}
    assert (view.source == DepthSource.FILLED).any()


def test_a_floor_that_no_wall_ends_is_not_continued_to_the_horizon(room):
    floor = RoomPlanes(np.array([[0.0, 0.0, 1.0]]), np.zeros(1), np.array([1000]), np.array([True]))
    level = dataclasses.replace(room.captures[0].camera, world_from_camera=look_at((0, 0, 1.5), (5, 0, 1.5)))
    assert floor.depths(level).max() > 100.0
    captures = [dataclasses.replace(room.captures[0], camera=level), *room.captures[1:]]
    unknown = with_holes(room.depth_maps[0], np.ones(room.depth_maps[0].depth.shape, bool))
    maps = [dataclasses.replace(unknown, camera=level), *room.depth_maps[1:]]
    farthest = max(depth_map.depth.max() for depth_map in maps[1:])
    view = complete_depth(captures, maps, floor, SETTINGS)[0]
    assert (view.depth > 0).all() and view.depth.max() < 2.1 * farthest
    assert (view.source == DepthSource.ENVELOPE).any()


def test_depth_that_others_see_through_is_not_trusted(room):
    floating = np.zeros(room.depth_maps[1].depth.shape, bool)
    floating[50:60, 60:75] = True
    depth = np.where(floating, 0.8, room.depth_maps[1].depth).astype(np.float32)
    maps = list(room.depth_maps)
    maps[1] = dataclasses.replace(maps[1], depth=depth)
    trusted = trusted_depth(maps, SETTINGS.stereo)
    assert (trusted[1].depth[floating] > 0).mean() < 0.05
    assert (trusted[1].depth[~floating] > 0).mean() > 0.97
    assert (trusted[0].depth > 0).mean() > 0.97


@pytest.mark.parametrize(("agreeing", "stays"), [(0, False), (1, True)])
def test_what_went_on_gives_way_where_more_captures_see_through_it_than_agree(agreeing, stays):
    near_m, wall_m = 2.0, 4.0
    facing = Camera(80, 60, 60.0, 60.0, 40.0, 30.0, np.eye(4))
    beside = np.eye(4)
    beside[0, 3] = 0.5
    source = np.full(facing.shape, DepthSource.PLANE, np.uint8)
    wall = CompletedDepth(np.full(facing.shape, wall_m, np.float32), source, facing.at(beside))
    source, depth = source.copy(), wall.depth.copy()
    source[20:40, 30:50], depth[20:40, 30:50] = DepthSource.FILLED, near_m
    source[:5], depth[:5] = DepthSource.PLANE, near_m
    hanging = CompletedDepth(depth, source, facing)
    same = CompletedDepth(np.full(facing.shape, near_m, np.float32), np.zeros_like(source), facing)
    bound = np.full(facing.shape, wall_m, np.float32)
    left = _unopposed(0, [hanging, wall, *[same] * agreeing], bound)
    assert (left.depth[20:40, 30:50] == (near_m if stays else wall_m)).all()
    assert (left.source[20:40, 30:50] == (DepthSource.FILLED if stays else DepthSource.ENVELOPE)).all()
    elsewhere = source != DepthSource.FILLED
    np.testing.assert_array_equal(left.depth[elsewhere], depth[elsewhere])
    np.testing.assert_array_equal(left.source[elsewhere], source[elsewhere])


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_homography_carries_pixels_through_the_plane(seed):
    rng = np.random.default_rng(seed)
    a = Camera(40, 30, 30.0, 31.0, 20.5, 14.0, look_at(rng.normal(size=3) * 0.3 + (0, -3, 1), (0, 0, 1)))
    b = Camera(50, 36, 42.0, 40.0, 24.0, 18.5, look_at(rng.normal(size=3) * 0.5 + (0.5, -3, 1), (0, 0, 1)))
    normal = np.array([0.2, -1.0, 0.1]) + rng.normal(size=3) * 0.2
    normal /= np.linalg.norm(normal)
    plane = RoomPlanes(normal[None], np.array([0.1]), np.ones(1, int), np.ones(1, bool))
    matrix = homography(a, b, plane.inverse_depth_rows(a)[0])
    depth = plane.depths(a)[0].astype(np.float64)
    row, column = np.nonzero((depth > 0.5) & (depth < 20))
    through = np.stack([column, row, np.ones(len(row))], 1) @ matrix.T
    pixels, _ = b.project(a.unproject(depth)[row, column])
    np.testing.assert_allclose(through[:, :2] / through[:, 2:] + 0.5, pixels, atol=1e-2)


def test_the_same_input_gives_the_same_bits(room, planes):
    a, b = (complete_depth(room.captures, room.depth_maps, planes, SETTINGS) for _ in range(2))
    for first, second in zip(a, b, strict=True):
        np.testing.assert_array_equal(first.depth, second.depth)


def test_save_and_load_round_trip(room, planes, tmp_path):
    view = complete_depth(room.captures, room.depth_maps, planes, SETTINGS)[0]
    view.save(tmp_path / "0.npz")
    loaded = CompletedDepth.load(tmp_path / "0.npz")
    np.testing.assert_array_equal(loaded.depth, view.depth)
    np.testing.assert_array_equal(loaded.source, view.source)
    assert loaded.camera.to_json() == view.camera.to_json()
    (tmp_path / "0.npz").write_bytes(b"PK\x03\x04nothing")
    with pytest.raises(GeometryError):
        CompletedDepth.load(tmp_path / "0.npz")

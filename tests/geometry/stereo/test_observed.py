"""Observed geometry: visibility, thinning, outliers, normals, sparse points, files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.sparse_points import SparsePoints
from r2sego_blender.config.settings import StereoSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.core.images import save_image
from r2sego_blender.geometry.stereo.observed import observe, require_observed
from r2sego_blender.geometry.stereo.observed_geometry import ObservedGeometry
from r2sego_blender.geometry.stereo.stereo import DepthMap

SETTINGS = StereoSettings(point_spacing_m=0.03)
WALL_Y_M = 3.01  # inside a voxel, not on the border of two


def wall_view(x: float) -> tuple[Camera, np.ndarray, np.ndarray]:
    """A camera before the wall, its exact depth and world normals."""
    pose = look_at(np.array([x, 0.0, 1.0]), np.array([0.3 * x, WALL_Y_M, 1.1]))
    camera = Camera(80, 60, 70.0, 70.0, 40.0, 30.0, pose)
    rays = camera.rays() @ pose[:3, :3].T
    depth = (WALL_Y_M / rays[..., 1]).astype(np.float32)
    normal = np.broadcast_to(np.float32([0.0, -1.0, 0.0]), (60, 80, 3)).copy()
    return camera, depth, normal


@pytest.fixture
def wall(tmp_path: Path) -> tuple[list[Capture], list[DepthMap]]:
    captures, maps = [], []
    for i, x in enumerate((-0.5, 0.0, 0.5)):
        camera, depth, normal = wall_view(x)
        image = np.full((60, 80, 3), (0.2, 0.4, 0.6), np.float32)
        save_image(tmp_path / f"{i}.png", image)
        captures.append(Capture(f"{i}", tmp_path / f"{i}.png", camera))
        cost = np.full((60, 80), 0.1, np.float32)
        maps.append(DepthMap(depth, normal, cost, np.full((60, 80), 2, np.uint8), camera))
    return captures, maps


def agreeing(points: np.ndarray, depth_map: DepthMap) -> np.ndarray:
    """Plain reference: the nearest pixel's depth agrees, which for a wall seen nearly
    head on says the same as its plane, but at the tolerance's edge."""
    pixels, depth = depth_map.camera.project(points)
    column = np.clip(pixels[:, 0].astype(int), 0, 79)
    row = np.clip(pixels[:, 1].astype(int), 0, 59)
    seen = np.where(depth_map.reliable(SETTINGS), depth_map.depth, 0.0)[row, column]
    return depth_map.camera.sees(pixels, depth) & (np.abs(seen - depth) < SETTINGS.consistency * depth)


def test_points_lie_on_the_wall_and_face_the_room(wall) -> None:
    observed = observe(*wall, None, SETTINGS)
    assert np.abs(observed.points[:, 1] - WALL_Y_M).max() < 1e-3
    assert observed.normals @ [0.0, -1.0, 0.0] == pytest.approx(1.0, abs=1e-4)
    np.testing.assert_allclose(observed.colours, [[0.2, 0.4, 0.6]] * len(observed.points), atol=3e-3)
    assert ((observed.confidence > 0.5) & (observed.confidence <= 1.0)).all()
    cells = np.floor(observed.points / SETTINGS.point_spacing_m).astype(int)
    assert len(np.unique(cells[:, [0, 2]], axis=0)) >= 0.9 * len(cells)


def test_visibility_is_true_where_the_depth_agrees(wall) -> None:
    captures, maps = wall
    hole = maps[1].support.copy()
    hole[:, :30] = 0
    nearer = maps[2].depth.copy()
    nearer[:20] *= 0.8
    maps = [maps[0], replace(maps[1], support=hole), replace(maps[2], depth=nearer)]
    observed = observe(captures, maps, None, SETTINGS)
    expected = np.stack([agreeing(observed.points, m) for m in maps], axis=1)
    assert (observed.visibility == expected).mean() > 0.99
    assert not observed.visibility[:, 1].all() and not observed.visibility[:, 2].all()
    assert (observed.visibility.sum(axis=1) >= 2).all()


def test_a_floating_patch_of_one_capture_is_dropped(wall) -> None:
    captures, maps = wall
    depth = maps[0].depth.copy()
    depth[10:14, 10:14] = 1.0
    observed = observe(captures, [replace(maps[0], depth=depth), *maps[1:]], None, SETTINGS)
    assert np.abs(observed.points[:, 1] - WALL_Y_M).max() < 0.05


def test_sparse_points_are_added_where_stereo_has_nothing(wall) -> None:
    captures, maps = wall
    points = np.array([[0.0, 1.5, 1.0], [0.1, 1.5, 1.0], [0.0, WALL_Y_M, 1.0]])
    seen = np.array([[True, True, True], [True, False, True], [True, True, True]])
    sparse = SparsePoints(
        points, np.full((3, 3), 255, np.uint8), seen, np.full(3, 0.3), np.zeros((3, 3, 2), np.float32)
    )
    without, observed = observe(captures, maps, None, SETTINGS), observe(captures, maps, sparse, SETTINGS)
    assert len(observed.points) == len(without.points) + 1
    np.testing.assert_allclose(observed.points[-1], points[0], atol=1e-6)
    np.testing.assert_array_equal(observed.visibility[-1], seen[0])
    assert observed.normals[-1, 1] < -0.9
    assert observed.confidence[-1] < without.confidence.min()


def test_the_same_captures_give_the_same_bits(wall) -> None:
    one, two = observe(*wall, None, SETTINGS), observe(*wall, None, SETTINGS)
    for name in ("points", "normals", "colours", "visibility", "confidence"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))


def test_observed_geometry_comes_back_from_its_file(wall, tmp_path: Path) -> None:
    observed = observe(*wall, None, SETTINGS)
    observed.save(tmp_path / "observed.npz")
    again = ObservedGeometry.load(tmp_path / "observed.npz")
    assert again.points.dtype == again.normals.dtype == again.confidence.dtype == np.float32
    np.testing.assert_array_equal(again.visibility, observed.visibility)
    (tmp_path / "observed.npz").write_bytes(b"")
    with pytest.raises(GeometryError, match="observed geometry"):
        ObservedGeometry.load(tmp_path / "observed.npz")


def test_no_supported_depth_is_an_error(wall) -> None:
    captures, maps = wall
    alone = [replace(m, support=np.zeros_like(m.support)) for m in maps]
    observed = observe(captures, alone, None, SETTINGS)
    assert not len(observed.points) and observed.visibility.shape == (0, len(captures))
    with pytest.raises(GeometryError, match="two photographs"):
        require_observed(observed)

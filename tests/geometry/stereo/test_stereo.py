"""Dense stereo on exact synthetic views: accuracy, normals, determinism, files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from r2sego_blender.captures.capture import Capture
from r2sego_blender.config.settings import StereoSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.core.images import save_image
from r2sego_blender.geometry.stereo.stereo import DepthMap, dense_stereo

SETTINGS = StereoSettings(iterations=4, geometric_rounds=1, max_side_px=160)
RANGE_M = (0.8, 6.0)


def texture(seed: int) -> np.ndarray:
    """(512, 512) smooth random grey in [0, 1], finest detail about three texels."""
    rng = np.random.default_rng(seed)
    layers = [gaussian_filter(rng.normal(size=(512, 512)), s, mode="wrap") * s for s in (1.5, 4.0, 10.0)]
    total = sum(layers)
    return np.clip(0.5 + 0.2 * total / total.std(), 0.0, 1.0)


def room_corner() -> list[tuple[np.ndarray, float, np.ndarray, np.ndarray, float]]:
    """Planes n . X = d of a floor, a wall and a slanted wall, each with the two axes and the
    texels a metre of its texture."""
    floor = (np.array([0.0, 0.0, 1.0]), 0.0)
    wall = (np.array([0.0, -1.0, 0.0]), -2.5)
    slant = np.array([-0.8, -0.6, 0.0])
    planes = [floor, wall, (slant, float(slant @ np.array([1.0, 2.0, 0.0])))]
    result = []
    for normal, d in planes:
        helper = np.array([1.0, 0.0, 0.0]) if abs(normal[2]) > 0.5 else np.array([0.0, 0.0, 1.0])
        s = np.cross(normal, helper)
        s /= np.linalg.norm(s)
        result.append((normal, d, s, np.cross(normal, s), 60.0))
    return result


def rendered(camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image (H, W, 3), exact depth (H, W) and world normals (H, W, 3) of the room corner:
    of the convex room, the nearest plane along each ray."""
    rays = camera.rays() @ camera.world_from_camera[:3, :3].T
    best = np.full(camera.shape, np.inf)
    grey = np.zeros(camera.shape)
    normals = np.zeros((*camera.shape, 3))
    for k, (normal, d, s, t, density) in enumerate(room_corner()):
        along = rays @ normal
        with np.errstate(divide="ignore"):
            depth = (d - camera.centre @ normal) / along
        front = (along < 0) & (depth > 0) & (depth < best)
        points = camera.centre + rays * np.where(front, depth, 1.0)[..., None]
        where = np.stack([points @ s, points @ t]) * density
        value = map_coordinates(texture(k), where, order=1, mode="grid-wrap")
        best = np.where(front, depth, best)
        grey = np.where(front, value, grey)
        normals[front] = normal
    return np.repeat(grey[..., None], 3, axis=-1).astype(np.float32), best, normals


@pytest.fixture(scope="module")
def scene(tmp_path_factory) -> tuple[list[Capture], list[np.ndarray], list[np.ndarray], np.ndarray]:
    folder = tmp_path_factory.mktemp("captures")
    captures, depths, normals = [], [], []
    for i, x in enumerate((-0.45, -0.15, 0.15, 0.45)):
        pose = look_at(np.array([x, -0.6, 1.3 + 0.05 * i]), np.array([0.1, 2.2, 0.6]))
        camera = Camera(160, 120, 130.0, 132.0, 80.5, 59.0, pose)
        image, depth, normal = rendered(camera)
        save_image(folder / f"{i}.png", image)
        captures.append(Capture(f"{i}", folder / f"{i}.png", camera))
        depths.append(depth)
        normals.append(normal)
    points = captures[1].camera.unproject(depths[1])[::10, ::10].reshape(-1, 3)
    return captures, depths, normals, points


@pytest.fixture(scope="module")
def maps(scene) -> tuple[DepthMap, ...]:
    captures, _, _, points = scene
    return dense_stereo(captures, [RANGE_M] * 4, points, SETTINGS, seed=3)


def test_depth_and_normals_are_those_of_the_rendered_planes(scene, maps) -> None:
    _, depths, normals, _ = scene
    for found, depth, normal in zip(maps, depths, normals, strict=True):
        reliable = found.reliable(SETTINGS)
        assert reliable.mean() > 0.7
        error = np.abs(found.depth - depth)[reliable] / depth[reliable]
        assert np.median(error) < 0.005
        assert (error < 0.03).mean() > 0.97
        cosine = (found.normal * normal).sum(axis=-1)[reliable]
        assert np.degrees(np.arccos(np.median(cosine).clip(-1, 1))) < 5.0
        np.testing.assert_allclose(np.linalg.norm(found.normal, axis=-1), 1.0, atol=1e-4)


def test_reliable_is_what_matched_well_and_another_capture_saw() -> None:
    depth, cost, support = np.meshgrid([0.0, 2.0], [0.2, 0.4, 0.41], [0, 1, 2], indexing="ij")
    camera = Camera(1, 1, 1.0, 1.0, 0.5, 0.5, np.eye(4))
    found = DepthMap(depth, np.zeros((*depth.shape, 3)), cost, support.astype(np.uint8), camera)
    reliable = found.reliable(replace(SETTINGS, max_cost=0.4))
    np.testing.assert_array_equal(reliable, (depth == 2.0) & (cost < 0.405) & (support > 0))


def test_support_counts_other_captures_only(maps) -> None:
    for found in maps:
        assert found.support.dtype == np.uint8
        assert found.support.max() <= 3
        assert (found.support[found.reliable(SETTINGS)] >= 1).all()


def test_the_same_bits_for_one_and_two_threads(scene, with_threads) -> None:
    captures, _, _, points = scene
    settings = replace(SETTINGS, max_side_px=80, iterations=2)

    def found():
        return dense_stereo(captures, [RANGE_M] * 4, points, settings, seed=1)

    for one, two in zip(with_threads(1, found), with_threads(2, found), strict=True):
        for name in ("depth", "normal", "cost", "support"):
            assert np.array_equal(getattr(one, name), getattr(two, name), equal_nan=True)


def test_sweeps_of_the_geometric_rounds_are_as_many_as_is_set(scene) -> None:
    captures, _, _, points = scene

    def found(rounds: int, sweeps: int) -> np.ndarray:
        settings = replace(SETTINGS, max_side_px=80, iterations=2, geometric_rounds=rounds, geometric_sweeps=sweeps)
        return dense_stereo(captures, [RANGE_M] * 4, points, settings, seed=1)[0].depth

    assert np.array_equal(found(0, 1), found(0, 4))
    assert not np.array_equal(found(1, 1), found(1, 4))


def test_another_seed_gives_other_bits(scene, maps) -> None:
    captures, _, _, points = scene
    settings = replace(SETTINGS, max_side_px=80, iterations=1, geometric_rounds=0)
    one, two = (dense_stereo(captures, [RANGE_M] * 4, points, settings, seed=s)[0] for s in (1, 2))
    assert not np.array_equal(one.depth, two.depth)


def test_no_sparse_points_are_needed(scene) -> None:
    captures, depths, _, _ = scene
    found = dense_stereo(captures, [RANGE_M] * 4, np.zeros((0, 3)), SETTINGS)
    reliable = found[1].reliable(SETTINGS)
    assert np.median(np.abs(found[1].depth - depths[1])[reliable] / depths[1][reliable]) < 0.005


def test_a_depth_map_comes_back_from_its_file(maps, tmp_path: Path) -> None:
    maps[0].save(tmp_path / "map.npz")
    again = DepthMap.load(tmp_path / "map.npz")
    for name in ("depth", "normal", "cost", "support"):
        np.testing.assert_array_equal(getattr(again, name), getattr(maps[0], name))
    assert again.camera.to_json() == maps[0].camera.to_json()
    replace(again, cost=again.cost[1:]).save(tmp_path / "map.npz")
    with pytest.raises(GeometryError, match="depth map"):
        DepthMap.load(tmp_path / "map.npz")
    (tmp_path / "map.npz").write_bytes(b"no depth map")
    with pytest.raises(GeometryError, match="depth map"):
        DepthMap.load(tmp_path / "map.npz")


def test_unusable_input_is_named(scene) -> None:
    captures, _, _, points = scene
    with pytest.raises(GeometryError, match="two photographs"):
        dense_stereo(captures[:1], [RANGE_M], points, SETTINGS)
    with pytest.raises(GeometryError, match="depth range"):
        dense_stereo(captures[:2], [RANGE_M, (2.0, 1.0)], points, SETTINGS)


def test_a_photograph_that_shares_nothing_stops_nobody_and_is_not_relied_on(scene) -> None:
    captures, depths, _, points = scene
    away = captures[3].camera.at(look_at(np.array([0.0, 0.0, 1.0]), np.array([0.0, -5.0, 1.0])))
    apart = [*captures[:3], replace(captures[3], camera=away)]
    found = dense_stereo(apart, [RANGE_M] * 4, points, SETTINGS)
    assert not found[3].reliable(SETTINGS).any()
    reliable = found[1].reliable(SETTINGS)
    assert reliable.mean() > 0.2
    assert np.median(np.abs(found[1].depth - depths[1])[reliable] / depths[1][reliable]) < 0.005

"""Photographs that share nothing: carried by an estimate or by the room's layout, from their files to the proxy."""

from __future__ import annotations

import numpy as np
import pytest
from box_room import lens, write_captures
from cameras_file import save_cameras_json
from disturbed_depth import disturbed

from r2sego_blender.bundle.runner import Plan
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.frame.scale import Scale
from r2sego_blender.captures.sparse_points import SPARSE
from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import look_at
from r2sego_blender.core.errors import CaptureError, GeometryError
from r2sego_blender.core.images import resize_nearest
from r2sego_blender.editing.recorded_depth import record_depth
from r2sego_blender.geometry.estimators.aligned_depth import ESTIMATED
from r2sego_blender.geometry.proxy.proxy import PROXY, Provenance
from r2sego_blender.geometry.room.completed_depth import COMPLETED
from r2sego_blender.geometry.stereo.observed_geometry import OBSERVED
from r2sego_blender.pipeline import refine
from r2sego_blender.refine.creation import create_scene
from r2sego_blender.splats.artifacts import INITIAL_ASSET

pytestmark = pytest.mark.slow

HEIGHT_M = 1.5
SMALL = {"stereo.max_side_px": 160, "stereo.iterations": 2, "stereo.levels": 2, "proxy.voxel_m": 0.05}
THINGS = (
    (np.array([-1.9, -0.5, 0.0]), np.array([-1.3, 0.5, 0.8])),
    (np.array([0.5, 1.2, 0.0]), np.array([1.3, 1.9, 1.0])),
)


def _colour(points: np.ndarray) -> np.ndarray:
    """Each wall, the floor and the ceiling of a shade of its own, with some grain: nothing that repeats."""
    x, y, z = np.moveaxis(points, -1, 0)
    shade = np.select(
        [z < 0.01, z > 2.49, x < -1.99, x > 1.99, y < -1.99, y > 1.99], [0.25, 0.9, 0.6, 0.7, 0.5, 0.65], 0.4
    )
    grain = 0.02 * np.sin(31 * x + 17 * y) * np.sin(23 * z + 11 * x)
    return np.stack([shade + grain, 0.9 * shade + grain, 0.8 * shade - grain], axis=-1)


@pytest.fixture(scope="module")
def photographs(tmp_path_factory):
    """Four photographs of a room, a quarter turn apart, with poses in metres; and their true depth."""
    folder = tmp_path_factory.mktemp("around")
    turns = np.radians([20.0, 110.0, 200.0, 290.0])
    centres = [np.array([0.2 * np.cos(a), 0.2 * np.sin(a), HEIGHT_M]) for a in turns]
    looks = [[2.0 * np.cos(a), 2.0 * np.sin(a), 0.9] for a in turns]
    cameras = [lens(320, 240).at(look_at(centre, at)) for centre, at in zip(centres, looks, strict=True)]
    captures, depths = write_captures(folder, cameras, boxes=THINGS, colour=_colour)
    save_cameras_json(folder / "cameras.json", captures, metric=True)
    return folder, depths


def _bundle(photographs, path, **overrides) -> Scene:
    folder, _ = photographs
    return create_scene(
        path,
        folder,
        folder / "cameras.json",
        scale=Scale.camera_height(HEIGHT_M),
        settings=CaptureSettings(max_side_px=320),
    ).declare(overrides=SMALL | overrides)


def _right(scene: Scene, depths, tolerance: float) -> float:
    completed = [resize_nearest(one.depth, 240, 320) for one in scene.read(COMPLETED).of(scene.read(CAPTURES))]
    return float(np.mean([np.abs(a / b - 1.0) < tolerance for a, b in zip(completed, depths, strict=True)]))


def _floor_m(scene: Scene) -> np.ndarray:
    """Heights of the proxy's level faces near the floor."""
    proxy = scene.read(PROXY.of_round(0))
    corners = proxy.vertices[proxy.faces].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    up = normals[:, 2] > 0.9 * np.linalg.norm(normals, axis=1)
    heights = corners[up].mean(axis=1)[:, 2]
    return heights[np.abs(heights) < 0.4]


@pytest.fixture(scope="module")
def recorded(photographs, tmp_path_factory):
    _, depths = photographs
    scene = _bundle(photographs, tmp_path_factory.mktemp("recorded") / "room.r2s")
    maps, rng = tmp_path_factory.mktemp("maps"), np.random.default_rng(3)
    for index, depth in enumerate(depths):
        np.save(maps / f"photo{index}.npy", disturbed(depth, rng))
    record_depth(scene, maps)
    scene = Scene.open(scene.path)
    refine(scene, until=PROXY.of_round(0).name)
    return scene


def test_recorded_depth_carries_what_shares_nothing(recorded, photographs):
    _, depths = photographs
    assert not len(recorded.read(SPARSE).points)
    assert _right(recorded, depths, 0.1) > 0.8
    assert np.abs(np.median(_floor_m(recorded))) < 0.05
    observed = recorded.read(OBSERVED)
    assert observed.estimated.mean() > 0.9 and (observed.visibility.sum(axis=1)[observed.estimated] == 1).all()
    assert len(recorded.read(INITIAL_ASSET)) > 1000
    proxy = recorded.read(PROXY.of_round(0))
    assert (proxy.provenance == Provenance.OBSERVED).mean() < 0.05
    assert (proxy.provenance == Provenance.ESTIMATED).mean() > 0.1


def test_the_layout_carries_what_nothing_else_does_and_is_named(photographs, tmp_path):
    _, depths = photographs
    scene = _bundle(photographs, tmp_path / "room.r2s")
    assert "depth_estimator" not in scene.backends
    refine(scene, until=PROXY.of_round(0).name)
    assert "layout" in scene.backends["depth_estimator"]
    assert _right(scene, depths, 0.25) > 0.6
    assert np.abs(np.median(_floor_m(scene))) < 0.05
    assert all((one.depth > 0.0).any() for one in scene.read(ESTIMATED).of(scene.read(CAPTURES)))
    plan = Plan(Scene.open(scene.path))
    refine(plan.scene, until=PROXY.of_round(0).name, runner=plan)
    assert [step.target for step in plan.steps].count(ESTIMATED.name) == 1
    assert not any(step.why for step in plan.steps)
    stamp = (scene.path / ESTIMATED.name).stat().st_mtime_ns
    refine(Scene.open(scene.path), until=COMPLETED.name)
    assert (scene.path / ESTIMATED.name).stat().st_mtime_ns == stamp


def test_without_estimate_and_layout_the_room_is_refused(photographs, tmp_path):
    scene = _bundle(photographs, tmp_path / "room.r2s", **{"proxy.layout": "never"})
    with pytest.raises(GeometryError, match="two photographs"):
        refine(scene, until=PROXY.of_round(0).name)


def test_without_poses_overlap_is_asked_for(photographs, tmp_path):
    folder, _ = photographs
    (tmp_path / "alone").mkdir()
    for file in folder.glob("*.png"):
        (tmp_path / "alone" / file.name).write_bytes(file.read_bytes())
    with pytest.raises(CaptureError, match="overlap"):
        create_scene(tmp_path / "room.r2s", tmp_path / "alone")
    assert not (tmp_path / "room.r2s").exists()

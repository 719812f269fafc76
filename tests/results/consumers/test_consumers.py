"""Folders for other people's training code: what their loaders read is there, and is the room."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import mujoco
import numpy as np
import pytest
from consumer_rooms import exported_room, surface
from pxr import Usd, UsdPhysics, UsdVol

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.geometry.collision.convex import convex_hull
from r2sego_blender.geometry.collision.merging import merged
from r2sego_blender.results.consumers.consumer import ExportedRoom
from r2sego_blender.results.consumers.playground import MOST_PIECES
from r2sego_blender.results.consumers.registry import CONSUMERS
from r2sego_blender.splats.formats.registry import load_asset
from r2sego_blender.splats.quaternions import to_rotation
from r2sego_blender.splats.rendering.rasterizer import render

ELSEWHERE = {"mjlab": "mjlab", "mujoco-warp": "mujoco_warp", "newton": "newton", "playground": "mujoco_playground"}


@pytest.fixture(scope="module")
def room(tmp_path_factory) -> ExportedRoom:
    return exported_room(tmp_path_factory.mktemp("room"))


def written(name: str, room: ExportedRoom, folder: Path) -> tuple[Path, ModuleType]:
    """A consumer's folder, moved to where it was not written, and its ``room.py``."""
    (folder / "made").mkdir()
    CONSUMERS[name].write(room, folder / "made")
    place = (folder / "made").rename(folder / "moved")
    spec = importlib.util.spec_from_file_location("room", place / "room.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return place, module


def dropped_at(model: mujoco.MjModel) -> float:
    """How high the centre of a ball of 2 cm comes to rest over the table."""
    data = mujoco.MjData(model)
    data.qpos[:3] = (1.1, -0.8, 0.9)
    for _ in range(600):
        mujoco.mj_step(model, data)
    return float(data.qpos[2])


def with_ball(spec: mujoco.MjSpec) -> mujoco.MjModel:
    ball = spec.worldbody.add_body(name="ball")
    ball.add_freejoint()
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(0.02, 0, 0))
    return spec.compile()


def test_there_is_a_consumer_for_every_name_that_the_command_tells():
    assert set(CONSUMERS) == {"gaussgym", "mjlab", "mujoco-warp", "newton", "playground"}
    assert all(one.about for one in CONSUMERS.values())


def test_mjlab_gets_the_room_below_one_fixed_body(room, tmp_path):
    _, module = written("mjlab", room, tmp_path)
    spec = module.spec_fn()
    assert [body.name for body in spec.bodies] == ["world", "room"] and not spec.joints
    assert len(spec.geoms) == len(surface().pieces) + 1
    assert dropped_at(with_ball(spec)) == pytest.approx(0.72, abs=0.015)


def test_playground_gets_an_xml_and_assets_by_their_names(room, tmp_path):
    _, module = written("playground", room, tmp_path)
    assets = module.assets()
    model = mujoco.MjModel.from_xml_string(module.xml(), assets=assets)
    assert model.geom("floor").type == mujoco.mjtGeom.mjGEOM_BOX and model.ngeom - 1 <= MOST_PIECES
    assert len(assets) == model.nmesh + 1 and all("/" not in name for name in assets)
    ball = '<worldbody><body><freejoint/><geom size="0.02"/></body></worldbody>'
    robot = f'<mujoco><include file="scene.xml"/>{ball}</mujoco>'
    assert dropped_at(mujoco.MjModel.from_xml_string(robot, assets=assets)) == pytest.approx(0.72, abs=0.015)


def test_fewer_pieces_hold_all_of_the_many():
    pieces = surface().pieces
    most = len(pieces) // 4
    fewer = merged(pieces, most)
    assert len(fewer) == most
    inside = np.zeros(sum(len(vertices) for vertices, _ in pieces), bool)
    points = np.concatenate([vertices for vertices, _ in pieces])
    for vertices, faces in fewer:
        corners = vertices[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        inside |= ((points @ normals.T - (corners[:, 0] * normals).sum(1)) <= 1e-6).all(1)
    assert inside.all()
    # What few pieces of a room can do: its middle stays free
    middle = np.array([[x, y, 1.2] for x in (-0.5, 0.0, 0.5) for y in (-0.5, 0.0, 0.5)])
    assert all((middle.min(0) > v.max(0)).any() or (middle.max(0) < v.min(0)).any() for v, _ in fewer)


def test_pieces_far_apart_stay_many():
    cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    pieces = [convex_hull(cube + np.array([3.0 * k, 0, 0])) for k in range(3)] + [
        convex_hull(cube + np.array([0, 1.0, 0]))
    ]
    found = merged(pieces, 1)
    assert len(found) == 3 and max(np.ptp(vertices[:, 1]) for vertices, _ in found) == 2.0


def test_mujoco_warp_gets_splats_whose_colours_are_those_of_degree_0(room, tmp_path):
    _, module = written("mujoco-warp", room, tmp_path)
    model = module.spec().compile()
    drawn = model.geom_group < 3
    assert drawn.sum() == 1 and not model.geom_contype[drawn].any()  # a grain, for there has to be one
    assert (~drawn).sum() == len(surface().pieces) + 1
    splats, asset = module.splats(), room.asset
    count = len(asset)
    assert {name: array.shape for name, array in splats.items()} == {
        "splat_position": (count, 3),
        "splat_rotation": (count, 4),
        "splat_scale": (count, 3),
        "splat_rgba": (count, 4),
    }
    assert all(array.dtype == np.float32 for array in splats.values())
    # The same Gaussians as ours: covariances, and the pixel of one alone
    axes = to_rotation(splats["splat_rotation"].astype(np.float64)) * splats["splat_scale"][:, None]
    ours = to_rotation(asset.quaternions.astype(np.float64)) * np.exp(asset.log_scales)[:, None]
    assert np.allclose(axes @ axes.transpose(0, 2, 1), ours @ ours.transpose(0, 2, 1), rtol=1e-4, atol=1e-9)
    one = asset.subset(np.array([int(np.argmax(asset.opacities * (asset.base_colours.min(axis=1) > 0)))]))
    where = one.means[0].astype(np.float64)
    camera = Camera(31, 31, 900.0, 900.0, 15.5, 15.5, look_at(where + np.array([0.5, 0.1, 0.2]), where))
    rgba = splats["splat_rgba"][np.flatnonzero((splats["splat_position"] == one.means[0]).all(axis=1))[0]]
    assert np.allclose(render(one.with_degree(0), camera).colour[15, 15], rgba[:3] * rgba[3], atol=0.01)


def test_newton_gets_one_stage_of_splats_and_pieces(room, tmp_path):
    place, _ = written("newton", room, tmp_path)
    stage = Usd.Stage.Open(str(place / "room.usda"))
    assert not stage.GetCompositionErrors()
    colliders = [prim for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.CollisionAPI)]
    assert len(colliders) == len(surface().pieces) + 1
    field = UsdVol.ParticleField3DGaussianSplat(stage.GetPrimAtPath("/room/splats"))
    assert field.GetRadianceSphericalHarmonicsDegreeAttr().Get() == 3  # of an asset of degree 1
    assert np.array_equal(field.GetPositionsAttr().Get(), room.asset.means)
    assert np.array_equal(load_asset(place / "splats.ply").sh, room.asset.sh)


@pytest.mark.parametrize("name", ELSEWHERE)
def test_the_consumers_own_loader_takes_it(room, tmp_path, name):
    package = pytest.importorskip(ELSEWHERE[name], reason=f"{ELSEWHERE[name]} is not installed here: docs/policy.md")
    _, module = written(name, room, tmp_path)
    if name == "mjlab":
        assert len(module.room_cfg().build().spec.geoms) == len(surface().pieces) + 1
    elif name == "mujoco-warp":
        model = with_ball(module.spec())
        context = package.create_render_context(model, 1, cam_res=(16, 16), **module.splats())
        assert context.splat_count == len(room.asset)
    elif name == "newton":
        builder = package.ModelBuilder()
        module.add_room(builder)
        assert builder.shape_count == len(surface().pieces) + 2
    else:
        assets: dict[str, bytes] = {}
        package._src.mjx_env.update_assets(assets, tmp_path / "moved", recursive=True)
        assert mujoco.MjModel.from_xml_string(module.xml(), assets=assets).ngeom > 1

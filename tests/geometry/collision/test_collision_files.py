"""The files of a collision surface: each is read back by what it is for."""

import re
import shutil
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import trimesh
from pxr import Usd, UsdGeom, UsdPhysics, UsdValidation

from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.collision.collision import CollisionSurface
from r2sego_blender.geometry.collision.collision_files import read_obj, write_collision
from r2sego_blender.geometry.collision.convex import convex_hull
from r2sego_blender.geometry.collision.floor_box import FloorBox


@pytest.fixture(scope="module")
def surface() -> CollisionSurface:
    """A floor turned by 30 degrees with three random convex pieces on it."""
    rng = np.random.default_rng(0)
    pieces = tuple(
        convex_hull(rng.uniform(-0.3, 0.3, (12, 3)) + centre) for centre in ((1, 0, 0.4), (0, 2, 1), (-3, 1, 2))
    )
    turn = np.radians(30)
    axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    floor = np.column_stack([np.array([[-2, -1], [2, -1], [2, 1], [-2, 1]]) @ axes + (0.5, 0.25), np.zeros(4)])
    return CollisionSurface(*pieces[0], pieces, floor, 0.02)


@pytest.fixture(scope="module")
def folder(surface, tmp_path_factory):
    folder = tmp_path_factory.mktemp("files") / "collision"
    write_collision(surface, folder)
    return folder


def world_vertices(model: mujoco.MjModel, geom: int) -> np.ndarray:
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mesh = model.geom_dataid[geom]
    start = model.mesh_vertadr[mesh]
    vertices = model.mesh_vert[start : start + model.mesh_vertnum[mesh]]
    return vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]


def same_points(first: np.ndarray, second: np.ndarray, atol: float) -> None:
    distance = np.linalg.norm(np.asarray(first)[:, None] - np.asarray(second)[None], axis=2)
    assert max(distance.min(0).max(), distance.min(1).max()) < atol


def box_corners(half: np.ndarray) -> np.ndarray:
    return np.array(np.meshgrid(*[(-size, size) for size in half])).reshape(3, -1).T


def same_floor(model: mujoco.MjModel, surface: CollisionSurface) -> None:
    (geom,) = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_BOX)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    corners = box_corners(model.geom_size[geom]) @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
    same_points(corners[corners[:, 2] > -0.1], surface.floor, 1e-6)


@pytest.mark.parametrize("name", ["scene.xml", "scene.urdf"])
def test_mujoco_compiles_the_scene_where_the_surface_is(surface, folder, name):
    model = mujoco.MjModel.from_xml_path(str(folder / name))
    assert model.nbody == 1 and model.nv == 0
    geoms = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)
    assert len(geoms) == len(surface.pieces) and model.ngeom == len(surface.pieces) + 1
    for geom, (vertices, _) in zip(geoms, surface.pieces, strict=True):
        same_points(world_vertices(model, geom), vertices, 1e-5)
    same_floor(model, surface)


def test_a_moved_folder_still_compiles(folder, tmp_path):
    moved = folder.rename(tmp_path / "elsewhere")
    try:
        for name in ("scene.xml", "scene.urdf"):
            assert mujoco.MjModel.from_xml_path(str(moved / name)).ngeom == 4
    finally:
        moved.rename(folder)


def test_the_urdf_is_one_link_whose_meshes_are_beside_it(surface, folder):
    root = ElementTree.parse(folder / "scene.urdf").getroot()
    assert root.tag == "robot" and [link.get("name") for link in root.iter("link")] == ["room"]
    assert not list(root.iter("joint"))
    names = [mesh.get("filename") for mesh in root.iter("mesh")]
    assert names[0] == "mesh.obj" and len(names) == 1 + len(surface.pieces)
    for name in names:
        assert not re.match(r"/|[a-z]+:", name) and (folder / name).is_file()
    collisions = [element.get("name") for element in root.iter("collision")]
    assert len(set(collisions)) == len(collisions) == 1 + len(surface.pieces)


def test_the_sdf_is_a_static_model_with_what_the_urdf_has(folder):
    sdf, urdf = (ElementTree.parse(folder / name).getroot() for name in ("scene.sdf", "scene.urdf"))
    (model,) = sdf.findall("model")
    assert sdf.get("version") == "1.7" and model.find("static").text == "true"
    files = [uri.text for uri in sdf.iter("uri")]
    assert files == [mesh.get("filename") for mesh in urdf.iter("mesh")]
    assert all((folder / file).is_file() for file in files)
    names = [[one.get("name") for one in root.iter("collision")] for root in (sdf, urdf)]
    assert names[0] == names[1]
    origin, box = urdf.find("link/collision/origin"), urdf.find("link/collision/geometry/box")
    pose = model.find("link/collision/pose").text
    assert pose.split() == [*origin.get("xyz").split(), *origin.get("rpy").split()]
    assert model.find("link/collision/geometry/box/size").text == box.get("size")


def test_the_urdf_weighs_nothing_so_that_pybullet_does_not_let_it_fall(folder):
    """It takes a link without an inertial for one of a kilogram, and one of no mass for fixed."""
    (link,) = ElementTree.parse(folder / "scene.urdf").getroot().iter("link")
    assert float(link.find("inertial/mass").get("value")) == 0.0
    inertia = link.find("inertial/inertia").attrib
    assert set(inertia) == {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"}
    assert not any(map(float, inertia.values()))


def test_the_usd_is_z_up_in_metres_and_its_points_are_ours(surface, folder):
    stage = Usd.Stage.Open(str(folder / "scene.usd"))
    assert UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdPhysics.GetStageKilogramsPerUnit(stage) == 1.0
    assert stage.GetDefaultPrim().GetPath() == "/room"
    for index, (vertices, faces) in enumerate(surface.pieces):
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/room/collision/piece_{index:04d}"))
        np.testing.assert_allclose(np.array(mesh.GetPointsAttr().Get()), vertices, atol=1e-6)
        np.testing.assert_array_equal(np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3), faces)
        assert (np.array(mesh.ComputeLocalToWorldTransform(Usd.TimeCode.Default())) == np.eye(4)).all()
    visual = UsdGeom.Mesh(stage.GetPrimAtPath("/room/visual"))
    np.testing.assert_allclose(np.array(visual.GetPointsAttr().Get()), surface.vertices, atol=1e-6)


def test_the_usd_collides_with_convex_hulls_and_the_floor_and_nothing_else(surface, folder):
    stage = Usd.Stage.Open(str(folder / "scene.usd"))
    colliders = [prim for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.CollisionAPI)]
    assert len(colliders) == len(surface.pieces) + 1
    assert not [prim for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.RigidBodyAPI)]
    meshes = [prim for prim in colliders if prim.IsA(UsdGeom.Mesh)]
    assert len(meshes) == len(surface.pieces)
    for prim in meshes:
        approximation = UsdPhysics.MeshCollisionAPI(prim).GetApproximationAttr().Get()
        assert approximation == UsdPhysics.Tokens.convexHull
        assert UsdGeom.Imageable(prim).ComputePurpose() == UsdGeom.Tokens.guide
    (scene,) = (prim for prim in stage.Traverse() if prim.IsA(UsdPhysics.Scene))
    assert UsdPhysics.Scene(scene).GetGravityMagnitudeAttr().Get() == pytest.approx(9.81)
    assert tuple(UsdPhysics.Scene(scene).GetGravityDirectionAttr().Get()) == (0, 0, -1)


def test_the_usd_floor_is_the_floor(surface, folder):
    stage = Usd.Stage.Open(str(folder / "scene.usd"))
    cube = UsdGeom.Cube(stage.GetPrimAtPath("/room/collision/floor"))
    half = np.full(3, cube.GetSizeAttr().Get() / 2)
    matrix = np.array(cube.ComputeLocalToWorldTransform(Usd.TimeCode.Default()))  # row vectors
    corners = np.column_stack([box_corners(half), np.ones(8)]) @ matrix
    same_points(corners[corners[:, 2] > -0.1][:, :3], surface.floor, 1e-6)


def test_usds_own_validators_find_no_fault(folder):
    stage = Usd.Stage.Open(str(folder / "scene.usd"))
    registry = UsdValidation.ValidationRegistry()
    validators = registry.GetOrLoadAllValidators()
    assert any(v.GetMetadata().name == "usdPhysicsValidators:ColliderChecker" for v in validators)
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    assert [f"{error.GetName()}: {error.GetMessage()}" for error in errors] == []


def test_a_scene_without_a_floor_has_none(surface, tmp_path):
    write_collision(replace(surface, floor=np.zeros((0, 3))), tmp_path)
    for name in ("scene.xml", "scene.urdf"):
        assert mujoco.MjModel.from_xml_path(str(tmp_path / name)).ngeom == len(surface.pieces)
    stage = Usd.Stage.Open(str(tmp_path / "scene.usd"))
    assert not stage.GetPrimAtPath("/room/collision/floor")
    assert not ElementTree.parse(tmp_path / "scene.sdf").getroot().findall(".//box")


_ROBOT = """<mujoco model="arm"><compiler meshdir="meshes"/>
<asset><mesh name="link" file="link.stl"/></asset>
<worldbody><body name="base" pos="0 0 1"><geom type="mesh" mesh="link"/>
<body name="arm" euler="0 0 90"><joint name="elbow" range="-45 90"/><geom type="mesh" mesh="link"/></body>
</body></worldbody></mujoco>"""


def _room_geoms(model, prefix):
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    ids = [g for g in range(model.ngeom) if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_BOX]
    ids += [g for g in range(model.ngeom) if model.geom(g).name.startswith(f"{prefix}piece_")]
    return np.concatenate([data.geom_xpos[ids], data.geom_xmat[ids], model.geom_size[ids]], axis=1)


def test_the_mjcf_is_attached_beside_a_robot_with_meshes_and_degrees_of_its_own(surface, folder, tmp_path):
    """As docs/simulators.md says it is done, in XML and in Python."""
    (tmp_path / "arm" / "meshes").mkdir(parents=True)
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "arm" / "meshes" / "link.stl")
    (tmp_path / "arm" / "arm.xml").write_text(_ROBOT)
    shutil.copytree(folder, tmp_path / "collision")
    alone = _room_geoms(mujoco.MjModel.from_xml_path(str(folder / "scene.xml")), "")
    (tmp_path / "world.xml").write_text(
        '<mujoco><asset><model name="room" file="collision/scene.xml"/>'
        '<model name="arm" file="arm/arm.xml"/></asset><worldbody>'
        '<attach model="room" prefix="room/"/><attach model="arm" prefix="arm/"/></worldbody></mujoco>'
    )
    in_xml = mujoco.MjModel.from_xml_path(str(tmp_path / "world.xml"))
    robot = mujoco.MjSpec.from_file(str(tmp_path / "arm" / "arm.xml"))
    room = mujoco.MjSpec.from_file(str(tmp_path / "collision" / "scene.xml"))
    robot.attach(room, prefix="room/", frame=robot.worldbody.add_frame())
    for model, elbow in ((in_xml, "arm/elbow"), (robot.compile(), "elbow")):
        np.testing.assert_allclose(_room_geoms(model, "room/"), alone, atol=1e-12)
        np.testing.assert_allclose(np.degrees(model.joint(elbow).range), (-45, 90))


def test_a_robot_beside_which_the_mjcf_is_included_keeps_its_degrees(surface, folder, tmp_path):
    shutil.copytree(folder, tmp_path / "out" / "collision")
    (tmp_path / "world.xml").write_text(
        '<mujoco><include file="out/collision/scene.xml"/><worldbody><body pos="0 0 1" euler="0 0 90">'
        '<joint name="turn" range="-45 90"/><geom size="0.1"/></body></worldbody></mujoco>'
    )
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "world.xml"))
    np.testing.assert_allclose(np.degrees(model.joint("turn").range), (-45, 90))
    np.testing.assert_allclose(model.body_quat[-1], (0.5**0.5, 0, 0, 0.5**0.5), atol=1e-12)


def test_the_floors_box_has_its_top_under_the_rectangle(surface):
    box = FloorBox.of(surface.floor)
    assert box.centre[2] + box.half[2] == pytest.approx(0.0)
    np.testing.assert_allclose(box.half[:2], (2, 1))
    assert box.yaw_rad == pytest.approx(np.radians(30))


def test_obj_files_are_read_as_they_were_written(surface, folder):
    vertices, faces = read_obj(folder / "hulls" / "piece_0001.obj")
    np.testing.assert_allclose(vertices, surface.pieces[1][0], atol=1e-6)
    np.testing.assert_array_equal(faces, surface.pieces[1][1])


@pytest.mark.parametrize(
    "text", ["v 0 0\n", "v 0 0 nan\nf 1 1 1\n", "v 0 0 0\nf 1 2 3\n", "f 0 1 2\n", "v a b c\n", f"f 1 1 {2**70}\n"]
)
def test_a_damaged_obj_file_is_refused(tmp_path, text):
    (tmp_path / "mesh.obj").write_text(text)
    with pytest.raises(GeometryError, match=r"mesh\.obj"):
        read_obj(tmp_path / "mesh.obj")
    with pytest.raises(GeometryError, match="nowhere"):
        read_obj(tmp_path / "nowhere.obj")

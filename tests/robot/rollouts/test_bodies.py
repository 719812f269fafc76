"""The robot's shapes and poses for those without MuJoCo, held against MuJoCo itself."""

from __future__ import annotations

import json
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import trimesh
from legged_robots import quadruped_mjcf
from made_up_room import made_up_bundle

from r2sego_blender.captures.store import CAPTURES, save_captures
from r2sego_blender.core.arrays import opened_arrays
from r2sego_blender.core.errors import RobotError
from r2sego_blender.refine.behaviour import DeclaredBehaviour
from r2sego_blender.results.robot_bodies import export_bodies
from r2sego_blender.robot.model.collision_shapes import colliding
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.rollouts.bodies import DESCRIPTION, POSES, SHAPES, body_poses, body_shapes, save_bodies
from r2sego_blender.robot.rollouts.rollout import Rollout, save_rollouts

PRIMITIVES = """<mujoco><worldbody><body name="b" pos="0 0 1"><freejoint/>
<geom type="sphere" size="0.1"/>
<geom type="box" size="0.1 0.2 0.3" pos="1 0 0" euler="20 30 40"/>
<geom type="capsule" size="0.1 0.4" pos="0 1 0" euler="50 10 0"/>
<geom type="cylinder" size="0.1 0.4" pos="0 2 0" euler="10 70 20"/>
<geom type="ellipsoid" size="0.1 0.2 0.3" pos="0 0 1" rgba="1 0 0 1"/>
<geom type="box" size="9 9 9" group="3"/>
</body></worldbody></mujoco>"""


def configurations(robot: RobotModel, count: int) -> np.ndarray:
    """(count, nq) random places, turns and joint angles."""
    rng = np.random.default_rng(5)
    qpos = robot.rest_qpos + rng.normal(0.0, 0.4, (count, robot.model.nq))
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    return qpos


def rollout_of(robot: RobotModel, count: int = 6) -> Rollout:
    qpos = configurations(robot, count)
    mount = robot.mount.pitched(30.0)
    return Rollout(
        success=True,
        reason="",
        frame=count - 1,
        qpos=qpos,
        times_s=0.2 * np.arange(count),
        camera_poses=robot.camera_poses(qpos, mount),
        seed=(0, 0),
    )


@pytest.mark.parametrize("name", ["humanoid", "wheeled", "quadruped", "hexapod"])
def test_poses_are_mujocos(name, request):
    robot = request.getfixturevalue(name)
    qpos, data = configurations(robot, 5), mujoco.MjData(robot.model)
    shapes = body_shapes(robot.model)
    poses = body_poses(robot.model, qpos, [shape.body for shape in shapes])
    assert poses.shape == (5, len(shapes), 4, 4)
    for frame, configuration in zip(poses, qpos, strict=True):
        data.qpos[:] = configuration
        mujoco.mj_forward(robot.model, data)
        for pose, shape in zip(frame, shapes, strict=True):
            expected = np.eye(4)
            expected[:3, :3] = data.body(shape.name).xmat.reshape(3, 3)
            expected[:3, 3] = data.body(shape.name).xpos
            np.testing.assert_allclose(pose, expected, rtol=0.0, atol=1e-12)


def test_every_primitive_has_its_size_and_place():
    model = mujoco.MjModel.from_xml_string(PRIMITIVES)
    (shape,) = body_shapes(model)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mesh = trimesh.Trimesh(shape.vertices, shape.faces, process=False)
    parts = mesh.split(only_watertight=True)
    assert len(parts) == 5  # the sixth is in a hidden group
    turns = data.geom_xmat.reshape(-1, 3, 3)
    volumes = [4 / 3 * np.pi * 0.1**3, 0.048, np.pi * 0.01 * (0.8 + 0.4 / 3), np.pi * 0.008, 0.008 * np.pi]
    up = np.array([0.0, 0.0, 1.0])  # where the body stands
    for part in parts:
        geom = int(np.argmin(np.linalg.norm(data.geom_xpos[:5] - up - part.centroid, axis=1)))
        np.testing.assert_allclose(part.centroid + up, data.geom_xpos[geom], atol=2e-3)
        assert 0.9 * volumes[geom] < part.volume < 1.001 * volumes[geom]
        own = (part.vertices + up - data.geom_xpos[geom]) @ turns[geom]
        half = np.abs(own).max(axis=0)
        np.testing.assert_allclose(half, model.geom_aabb[geom, 3:], atol=0.008)  # of 16 corners around
    assert {tuple(c) for c in shape.colours} == {(0.5, 0.5, 0.5), (1.0, 0.0, 0.0)}


def test_the_standing_robot_is_as_tall_as_mujoco_says(humanoid):
    shapes = body_shapes(humanoid.model)
    poses = body_poses(humanoid.model, humanoid.rest_qpos[None], [shape.body for shape in shapes])[0]
    world = np.concatenate([s.vertices @ p[:3, :3].T + p[:3, 3] for s, p in zip(shapes, poses, strict=True)])
    assert world[:, 2].min() == pytest.approx(0.0, abs=2e-3)
    assert world[:, 2].max() == pytest.approx(humanoid.height_m, abs=2e-3)
    assert len(shapes) == len(set(humanoid.model.geom_bodyid[colliding(humanoid.model)]))


def test_drawn_meshes_are_shown_in_place_of_those_that_collide(shared_robot):
    robot = RobotModel.load(
        shared_robot("g1/unitree_mujoco_g1/g1_29dof.xml"),
        ["torso_link", [0.0576, 0.0175, 0.4299], [0.0, 0.83, 0.0], {"hfov_deg": 69}],
    )
    drawn = (robot.model.geom_contype | robot.model.geom_conaffinity) == 0
    for shape in body_shapes(robot.model):
        geoms = np.flatnonzero(robot.model.geom_bodyid == shape.body)
        shown = geoms[drawn[geoms]] if drawn[geoms].any() else geoms
        if (robot.model.geom_type[shown] == mujoco.mjtGeom.mjGEOM_MESH).all():
            assert len(shape.faces) == robot.model.mesh_facenum[robot.model.geom_dataid[shown]].sum()


def test_files_hold_what_was_computed(humanoid, tmp_path):
    rollouts = (
        rollout_of(humanoid),
        replace(rollout_of(humanoid), qpos=np.empty((0, 36)), camera_poses=np.empty((0, 4, 4)), times_s=np.empty(0)),
    )
    (tmp_path / "rollouts.npz").write_bytes(b"these")
    save_bodies(tmp_path, humanoid, rollouts, humanoid.camera(64, 48), tmp_path)
    shapes = body_shapes(humanoid.model)
    with opened_arrays(tmp_path / POSES, RobotError, "") as arrays:
        expected = body_poses(humanoid.model, rollouts[0].qpos, [shape.body for shape in shapes])
        np.testing.assert_array_equal(arrays["world_from_body_0000"], expected)
        assert arrays["world_from_body_0001"].shape == (0, len(shapes), 4, 4)
    with opened_arrays(tmp_path / SHAPES, RobotError, "") as arrays:
        np.testing.assert_array_equal(arrays["vertices_0003"], shapes[3].vertices)
        assert len(arrays) == 3 * len(shapes)


def test_flights_have_no_body(humanoid, tmp_path):
    flight = replace(rollout_of(humanoid), qpos=np.empty((6, 0)))
    (tmp_path / "rollouts.npz").write_bytes(b"these")
    save_bodies(tmp_path, humanoid, [flight], humanoid.camera(64, 48), tmp_path)
    with opened_arrays(tmp_path / POSES, RobotError, "") as arrays:
        assert arrays["world_from_body_0000"].shape == (6, 0, 4, 4)


def test_another_robots_rollouts_are_refused(humanoid, wheeled, shared_robot, tmp_path):
    lens = humanoid.camera(64, 48)
    with pytest.raises(RobotError, match="rollout 0 is another robot's than embedded:wheeled"):
        save_bodies(tmp_path, wheeled, [rollout_of(humanoid)], lens, tmp_path)
    like = RobotModel.load(
        shared_robot("g1/unitree_mujoco_g1/g1_29dof.xml"),
        ["pelvis", [0.0576, 0.0175, 0.4299], [0.0, 0.83, 0.0], {"hfov_deg": 69}],
    )
    assert like.model.nq == humanoid.model.nq
    with pytest.raises(RobotError, match="another robot's"):
        save_bodies(tmp_path, like, [rollout_of(humanoid)], lens, tmp_path)
    assert not list(tmp_path.iterdir())


def test_bodies_are_made_anew_when_a_file_that_the_robots_names_has_changed(tmp_path):
    head, trunk, rest = quadruped_mjcf().partition('<geom type="box" size="0.2 0.05 0.05" mass="7"/>')
    robot, included = tmp_path / "robot.xml", tmp_path / "trunk.xml"
    robot.write_text(f'{head}<include file="trunk.xml"/>{rest}')
    included.write_text(f"<mujoco>{trunk}</mujoco>")
    scene = made_up_bundle(tmp_path / "room.r2s").declare(robot=str(robot))
    (scene.path / "rounds/0/rollouts").mkdir()
    save_rollouts(scene.path / "rounds/0/rollouts", [rollout_of(RobotModel.load(str(robot)))])
    before = (export_bodies(scene, 0) / SHAPES).read_bytes()
    included.write_text(f"<mujoco>{trunk}</mujoco>".replace("0.2 0.05", "0.3 0.05"))
    assert (export_bodies(scene, 0) / SHAPES).read_bytes() != before


def test_the_camera_that_is_shown_is_the_one_that_rounds_score_of_upright_photographs_too(tmp_path, humanoid):
    scene = made_up_bundle(tmp_path / "room.r2s")
    upright = [
        replace(capture, camera=replace(capture.camera, width=480, height=640)) for capture in scene.read(CAPTURES)
    ]
    (scene.path / "rounds/0/rollouts").mkdir()
    save_rollouts(scene.path / "rounds/0/rollouts", [rollout_of(humanoid)])
    save_captures(scene.captures_folder, upright)
    shown = json.loads((export_bodies(scene, 0) / DESCRIPTION).read_text())["camera"]
    scored = DeclaredBehaviour.of(scene).ego_camera(scene.read(CAPTURES))
    assert (shown["width"], shown["height"], shown["fx"]) == (scored.width, scored.height, scored.fx)
    assert (scored.width, scored.height) == (640, 480)

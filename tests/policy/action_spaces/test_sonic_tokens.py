"""Tokens drive the robot through a decoder whose answers are known: a linear map with the real names and shapes."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from expected_errors import refused
from legged_robots import quadruped_mjcf
from sonic_networks import decoder, encoder, linear_network

from r2sego_blender.config.settings import RolloutSettings
from r2sego_blender.core.errors import RobotError
from r2sego_blender.policy.action_spaces import sonic_layout as layout
from r2sego_blender.policy.action_spaces.slot import action_space
from r2sego_blender.policy.action_spaces.sonic_networks import DECODER, ENCODER
from r2sego_blender.robot.controllers.onnx_network import OnnxNetwork
from r2sego_blender.robot.model.model import RobotModel

pytest.importorskip("onnx", reason="make install POLICY=1")

FLOOR_Z_M = 0.1
ROOM = f'<mujoco><worldbody><geom name="floor" type="plane" size="5 5 1" pos="0 0 {FLOOR_Z_M}"/></worldbody></mujoco>'


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return RobotModel.load()


@pytest.fixture
def room(tmp_path):
    (tmp_path / "room.xml").write_text(ROOM)
    return tmp_path / "room.xml"


def test_the_decoder_is_asked_every_fourth_step_and_its_targets_are_held(robot, room, tmp_path):
    rng = np.random.default_rng(3)
    weight, bias = 0.01 * rng.normal(size=(994, 29)), 0.1 * rng.normal(size=29)
    space = action_space("sonic_tokens")
    composition = space.composition(robot, room, RolloutSettings())
    model = composition.model
    assert (model.opt.timestep, model.nu, space.SIZE, composition.has_wrench) == (0.005, 29, 64, False)
    assert np.allclose(model.actuator_gainprm[:, 0], [servo.stiffness for servo in layout.SERVOS.values()])
    assert np.allclose(-model.actuator_biasprm[:, 2], [servo.damping for servo in layout.SERVOS.values()])
    drive = space.make(robot, composition, FLOOR_Z_M, decoder=decoder(tmp_path / "decoder.onnx", weight, bias))
    data = mujoco.MjData(model)
    data.qpos[:] = drive.start(np.array([0.4, -0.2]), 0.7)
    token = rng.integers(-16, 16, 64) / 16.0
    drive.act(token)

    # Written anew from the layout in the facts: what is felt at 0, 4 and 8, each told once
    frames, action, told = [], np.zeros(29, np.float32), []
    order = np.argsort(layout.ISAACLAB_TO_MUJOCO)
    for step in range(12):
        if step % 4 == 0:
            base = data.xmat[model.body("robot/pelvis").id] if step else _matrix(data.qpos[3:7])
            joints = data.qpos[7:] - layout.DEFAULT_RAD
            gravity = base.reshape(3, 3).T @ [0.0, 0.0, -1.0]
            frames.append((data.qvel[3:6].copy(), joints[order], data.qvel[6:][order], action, gravity))
            ten = [frames[0]] * (10 - len(frames)) + frames
            observation = np.concatenate([token, *(frame[kind] for kind in range(5) for frame in ten)])
            action = observation.astype(np.float32) @ weight.astype(np.float32) + bias.astype(np.float32)
            target = layout.DEFAULT_RAD + layout.ACTION_SCALE * action[layout.ISAACLAB_TO_MUJOCO]
        drive.apply(data, step)
        told.append(data.ctrl.copy())
        assert np.allclose(data.ctrl, target, atol=1e-5)
        mujoco.mj_step(model, data)
        mujoco.mj_kinematics(model, data)
    assert np.array_equal(told[0], told[3]) and not np.allclose(told[3], told[4])


def _matrix(quaternion: np.ndarray) -> np.ndarray:
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix


def test_it_starts_at_the_default_with_its_soles_on_the_floor_and_forgets(robot, room, tmp_path):
    zeros = decoder(tmp_path / "decoder.onnx", np.eye(994, 29), np.zeros(29))
    space = action_space("sonic_tokens")
    composition = space.composition(robot, room, RolloutSettings())
    drive = space.make(robot, composition, FLOOR_Z_M, decoder=zeros)
    data = mujoco.MjData(composition.model)
    first = drive.start(np.array([1.0, 2.0]), -1.2)
    assert np.allclose(first[:2], [1.0, 2.0]) and np.allclose(first[7:], layout.DEFAULT_RAD)
    assert np.arctan2(*_matrix(first[3:7]).reshape(3, 3)[1::-1, 0]) == pytest.approx(-1.2)
    data.qpos[:] = first
    mujoco.mj_forward(composition.model, data)
    deepest = data.contact.dist[: data.ncon].min(initial=1.0)
    assert abs(deepest) < 2e-3
    drive.act(np.full(64, 9.0))
    drive.apply(data, 0)
    assert data.ctrl[0] == pytest.approx(layout.DEFAULT_RAD[0] + layout.ACTION_SCALE[0])  # beyond 1 is 1
    assert np.array_equal(drive.start(np.array([1.0, 2.0]), -1.2), first)
    drive.apply(data, 0)
    assert np.allclose(data.ctrl, layout.DEFAULT_RAD)


def test_a_robot_without_the_joints_is_refused(room, tmp_path):
    (tmp_path / "dog.xml").write_text(quadruped_mjcf())
    with refused(RobotError, tmp_path / "dog.xml", "left_hip_pitch_joint"):
        action_space("sonic_tokens").composition(RobotModel.load(tmp_path / "dog.xml"), room, RolloutSettings())


def test_the_encoder_gives_a_token_of_a_motion(tmp_path):
    weight = np.zeros((1762, 64))
    weight[4:68] = 0.5 * np.eye(64)
    network = OnnxNetwork(encoder(tmp_path / "encoder.onnx", weight, np.full(64, 0.25)), ENCODER)
    seen = layout.encoder_observation(np.ones((10, 29)), np.zeros((10, 29)), np.eye(4)[0], np.eye(4)[[0] * 10])
    assert np.array_equal(network(seen), np.full(64, 0.75, np.float32))


@pytest.mark.parametrize(
    ("shape", "output", "source"),
    [((994, 28), "action", "obs_dict"), ((993, 29), "action", "obs_dict"), ((994, 29), "actions", "obs_dict"),
     ((994, 29), "action", "obs")],
)  # fmt: skip
def test_another_network_is_refused(tmp_path, shape, output, source):
    path = linear_network(tmp_path / "other.onnx", np.zeros(shape), np.zeros(shape[1]), output, source)
    with refused(RobotError, path, "decoder"):
        OnnxNetwork(path, DECODER)


def test_numbers_that_are_not_finite_are_refused(tmp_path):
    path = decoder(tmp_path / "decoder.onnx", np.zeros((994, 29)), np.full(29, np.nan))
    with refused(RobotError, path, "finite"):
        OnnxNetwork(path, DECODER)


def test_a_program_is_refused_before_it_is_read(tmp_path):
    with refused(RobotError, "decoder.pt", "program"):
        OnnxNetwork(tmp_path / "decoder.pt", DECODER)

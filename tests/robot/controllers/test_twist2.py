"""TWIST2 tracks motions unaided: its layout against numbers written by hand, and its policy where it is at hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from expected_errors import refused
from hypothesis import given
from hypothesis import strategies as st
from policy_controllers import only
from scipy.spatial.transform import Rotation
from sonic_networks import linear_network

from r2sego_blender.config.settings import RolloutSettings
from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.controllers import twist2_layout as layout
from r2sego_blender.robot.controllers.commanded_drive import CommandedDrive, DriveCommand
from r2sego_blender.robot.controllers.controller import check_controller, make_controller
from r2sego_blender.robot.controllers.twist2 import Twist2
from r2sego_blender.robot.controllers.velocity_pursuit import heading_rad
from r2sego_blender.robot.model.composition import compose
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.model.unitree_g1 import JOINTS
from r2sego_blender.robot.planning.free_floor import free_floor
from r2sego_blender.robot.rollouts.attempts import Attempts
from r2sego_blender.robot.scope.scope import BehaviourScope, Control, Episode, Failures

SCOPE = BehaviourScope.load("walk_and_look")
POLICY = "g1/policies/twist2_1017_20k.onnx"
G1 = "g1/unitree_mujoco_g1/g1_29dof.xml"
G1_MOUNT = ["torso_link", [0.0576235, 0.01753, 0.42987], [0.0, 0.8307767, 0.0], {"hfov_deg": 69.0}]


def tracked(scope: BehaviourScope, policy: Path, **control) -> BehaviourScope:
    return replace(scope, controller=Control(tracker=str(policy), **control))


@pytest.fixture
def network(tmp_path):
    """``network(seed)`` writes a linear policy, and gives its file, weight and bias."""
    pytest.importorskip("onnx", reason="make install POLICY=1")

    def write(seed: int = 0, inputs: int = 1432, output: str = "output") -> tuple[Path, np.ndarray, np.ndarray]:
        rng = np.random.default_rng(seed)
        weight, bias = 0.01 * rng.normal(size=(inputs, 29)), 0.1 * rng.normal(size=29)
        return linear_network(tmp_path / f"{seed}.onnx", weight, bias, output, "input"), weight, bias

    return write


# The layout, as shared/anchors/policy.md and TWIST2's deployed code say it


@pytest.mark.parametrize(
    ("joint", "default", "stiffness", "damping"),
    [
        ("left_hip_pitch", -0.2, 100.0, 2.0),
        ("right_hip_yaw", 0.0, 100.0, 2.0),
        ("right_knee", 0.4, 150.0, 4.0),
        ("left_ankle_pitch", -0.2, 40.0, 2.0),
        ("right_ankle_roll", 0.0, 40.0, 2.0),
        ("waist_yaw", 0.0, 150.0, 4.0),
        ("waist_pitch", 0.0, 150.0, 4.0),
        ("left_shoulder_roll", 0.4, 40.0, 5.0),
        ("right_shoulder_roll", -0.4, 40.0, 5.0),
        ("right_elbow", 1.2, 40.0, 5.0),
        ("left_wrist_roll", 0.0, 4.0, 0.2),
        ("right_wrist_yaw", 0.0, 4.0, 0.2),
    ],
)
def test_defaults_and_gains(joint, default, stiffness, damping):
    index, servo = JOINTS.index(f"{joint}_joint"), layout.SERVOS[f"{joint}_joint"]
    assert (layout.DEFAULT_RAD[index], servo.stiffness, servo.damping) == (default, stiffness, damping)


def test_targets_are_half_the_action_clipped_at_ten():
    action = np.linspace(-30.0, 30.0, 29)
    expected = [d + 0.5 * max(-10.0, min(10.0, a)) for d, a in zip(layout.DEFAULT_RAD, action, strict=True)]
    assert np.allclose(layout.targets_of(action), expected)


def test_a_frame_its_ten_predecessors_and_the_motion_once_more():
    seen, upright = layout.Observation(), np.array([1.0, 0.0, 0.0, 0.0])
    for t in range(13):
        told = layout.mimic(upright, 3.0 * np.arange(29) + t, np.array([0.1, 0.2]) + t, 0.3 + t, 0.7 + t)
        felt = layout.proprioception(
            upright,
            turning=np.array([4.0, 8.0, 12.0]) + 4.0 * t,
            joints=layout.DEFAULT_RAD + np.arange(29) + 100.0 * t,
            velocities=20.0 * np.arange(1, 30) + 20.0 * t,
            action=-np.arange(29) - 50.0 * t,
        )
        observation = seen.observe(told, felt)
    assert observation.shape == (1432,) and observation.dtype == np.float32
    # The newest frame is the thirteenth (t = 12), those of the past are t = 2 to 11
    for offset, t in [(0, 12.0), *((127 * (1 + past), 2.0 + past) for past in range(10))]:
        frame = observation[offset : offset + 127]
        assert np.allclose(frame[:6], [0.1 + t, 0.2 + t, 0.7 + t, 0.0, 0.0, 0.3 + t])
        assert np.allclose(frame[6:35], 3.0 * np.arange(29) + t)
        assert np.allclose(frame[35:40], [1.0 + t, 2.0 + t, 3.0 + t, 0.0, 0.0])
        assert np.allclose(frame[40:69], np.arange(29) + 100.0 * t, atol=1e-4)
        velocities = np.arange(1, 30) + t
        velocities[[4, 5, 10, 11]] = 0.0  # the ankles
        assert np.allclose(frame[69:98], velocities)
        assert np.allclose(frame[98:127], -np.arange(29) - 50.0 * t)
    assert np.array_equal(observation[1397:], observation[:35])


def test_the_past_is_zeros_before_the_first_frame():
    observation = layout.Observation().observe(np.ones(35), np.ones(92))
    assert observation[:127].all() and not observation[127:1397].any() and observation[1397:].all()


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_roll_and_pitch_are_of_turns_about_z_then_y_then_x(roll, pitch, yaw):
    quaternion = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat(scalar_first=True)
    told = layout.mimic(quaternion, np.zeros(29), np.zeros(2), 0.0, 0.0)
    assert np.allclose(told[3:5], [roll, pitch], atol=1e-6)


# What drives it


def test_the_policy_is_asked_at_fifty_hertz_about_the_motion_and_nothing_helps(humanoid, box_room, network):
    """Everything written anew: what is told, felt and commanded."""
    file, weight, bias = network()
    scope, scene = tracked(only(SCOPE, walk_to=1.0), file), box_room(())
    controller = make_controller(humanoid, free_floor(humanoid, scope, scene), scope, scene, RolloutSettings())
    model = controller.composition.model
    assert not controller.composition.has_wrench and (model.nu, model.opt.timestep, model.nmocap) == (29, 0.002, 0)
    assert file.name in controller.name and "twist2" in controller.name
    drive = controller.draw(np.random.default_rng(4))
    motion = drive._motion
    data, past, action = mujoco.MjData(model), [np.zeros(127)] * 10, np.zeros(29)
    data.qpos[:] = drive.qpos
    for step in range(41):
        if step % 10 == 0:
            qpos, qvel = motion.qpos[step // 10], motion.qvel[step // 10]
            now = Rotation.from_quat(data.qpos[3:7], scalar_first=True)
            wanted = now.inv().apply([*(qvel[:2] + qpos[:2] - data.qpos[:2]), qvel[2]])
            turned = np.angle(np.exp(1j * (heading_rad(qpos) - heading_rad(data.qpos))))
            told = np.array([*wanted[:2], qpos[2], 0.0, 0.0, qvel[5] + turned, *qpos[7:]])
            _, pitch, roll = now.as_euler("ZYX")
            velocities = 0.05 * data.qvel[6:]
            velocities[[4, 5, 10, 11]] = 0.0
            felt = [*(0.25 * data.qvel[3:6]), roll, pitch, *(data.qpos[7:] - layout.DEFAULT_RAD), *velocities, *action]
            frame = np.array([*told, *felt])
            action = np.concatenate([frame, *past, told]) @ weight + bias
            past = [*past[1:], frame]
        drive.apply(data, step)
        assert np.allclose(data.ctrl, layout.DEFAULT_RAD + 0.5 * action, atol=1e-4), step
        mujoco.mj_step(model, data)


def test_a_commanded_drive_is_tracked_too_and_begins_anew(humanoid, box_room, network):
    twist2 = Twist2(network()[0], humanoid)
    composition = twist2.compose(box_room(()), RolloutSettings())
    drive = CommandedDrive(humanoid, composition, 0.0, tracker=twist2.tracker(composition, 0.0))
    told = []
    for _ in range(2):
        data = mujoco.MjData(composition.model)
        data.qpos[:] = drive.start(np.zeros(2), 0.3)
        drive.command(DriveCommand(0.4))
        for step in range(60):
            drive.apply(data, step)
            mujoco.mj_step(composition.model, data)
        told.append(data.ctrl.copy())
    assert np.array_equal(*told) and drive.mean_assist_n == 0.0
    assisted = compose(humanoid, box_room(()), RolloutSettings())
    for other, tracker in ((composition, None), (assisted, twist2.tracker(composition, 0.0))):
        with refused(RobotError, humanoid.source, "wrench"):
            CommandedDrive(humanoid, other, 0.0, tracker=tracker)


def test_a_robot_with_other_joints_is_refused(quadruped, network):
    file = network()[0]
    with refused(RobotError, quadruped.source, "29 joints"):
        check_controller(quadruped, tracked(SCOPE, file))


@pytest.mark.parametrize("other", [{"inputs": 1431}, {"output": "actions"}])
def test_another_network_is_refused(humanoid, network, other):
    file = network(**other)[0]
    with refused(RobotError, file, "TWIST2"):
        check_controller(humanoid, tracked(SCOPE, file))


def test_a_policy_that_balances_itself_has_nothing_to_track(humanoid, network, tmp_path):
    file = network()[0]
    scope = tracked(SCOPE, file, kind="policy", file=str(tmp_path / "walk.onnx"), layout="falcon_g1_29dof")
    with refused(RobotError, scope.name, "controller.tracker"):
        check_controller(humanoid, scope)


def test_a_scope_names_the_file_beside_it_and_is_the_old_one_without(tmp_path):
    (tmp_path / "tracker.onnx").write_bytes(b"")
    (tmp_path / "mine.toml").write_text("[controller]\ntracker = 'tracker.onnx'\n")
    scope = BehaviourScope.load(tmp_path / "mine.toml")
    assert scope.controller.tracker == str(tmp_path / "tracker.onnx")
    assert scope.files == (tmp_path / "tracker.onnx",)


# TWIST2's own policy


@pytest.fixture(scope="module")
def g1(shared_robot) -> RobotModel:
    return RobotModel.load(shared_robot(G1), G1_MOUNT)


def test_planned_walks_arrive_unaided(g1, shared_robot, box_room):
    walks = replace(only(SCOPE, walk_to=1.0), episode=Episode(duration_s=6.0))
    walks = replace(walks, failures=Failures(penetration_m=0.03, slide_m=0.1))
    scope, scene = tracked(walks, shared_robot(POLICY)), box_room()
    floor = free_floor(g1, scope, scene)
    attempts = Attempts(g1.source, g1.mount, scope, floor, scene, RolloutSettings(), seed=1)
    found = [attempts.run(number) for number in range(2)]
    assert any(rollout.success for rollout in found)
    for rollout in found:
        assert rollout.reason != "fall" and rollout.quality.assist_n == 0.0 and "twist2" in rollout.controller


@pytest.mark.parametrize("command", [DriveCommand(0.4), DriveCommand(yaw_rate_rad_s=0.6)], ids=str)
def test_who_is_commanded_walks_and_turns_unaided(g1, shared_robot, tmp_path, command):
    scene = tmp_path / "scene.xml"
    scene.write_text('<mujoco><worldbody><geom type="box" pos="0 0 -0.05" size="9 9 0.05"/></worldbody></mujoco>')
    twist2 = Twist2(shared_robot(POLICY), g1)
    composition = twist2.compose(scene, RolloutSettings())
    drive = CommandedDrive(g1, composition, 0.0, tracker=twist2.tracker(composition, 0.0))
    data, seconds = mujoco.MjData(composition.model), 3.0
    data.qpos[:] = drive.start(np.zeros(2), 0.0)
    drive.command(command)
    headings, lowest_m = [], 1.0
    for step in range(round(seconds / composition.model.opt.timestep)):
        drive.apply(data, step)
        mujoco.mj_step(composition.model, data)
        headings.append(heading_rad(data.qpos))
        lowest_m = min(lowest_m, float(data.qpos[2]))
    done = np.array([data.qpos[0], np.unwrap(headings)[-1]]) / seconds
    assert np.allclose(done, [command.vx_m_s, command.yaw_rate_rad_s], atol=0.15) and lowest_m > 0.68
    assert drive.mean_assist_n == 0.0

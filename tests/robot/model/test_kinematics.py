"""Leg inverse kinematics against MuJoCo's forward kinematics, and a solver written out plainly."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from legged_robots import quadruped_mjcf
from scipy.optimize import least_squares

from r2sego_blender.robot.model.kinematics import LegSolver
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.model.structure import posed

ROBOTS = ("humanoid", "quadruped", "hexapod")


@pytest.fixture(params=ROBOTS)
def robot(request) -> RobotModel:
    return request.getfixturevalue(request.param)


def reachable_tips(robot: RobotModel, frames: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Bases (frames, nq) and tips (L, frames, 4), around the resting robot's, turned and moved."""
    qpos = np.tile(robot.rest_qpos, (frames, 1))
    yaw = rng.uniform(-3.0, 3.0, frames)
    qpos[:, :2] = rng.uniform(-2.0, 2.0, (frames, 2))
    qpos[:, 2] *= rng.uniform(0.9, 0.97, frames)
    qpos[:, 3], qpos[:, 6] = np.cos(yaw / 2.0), np.sin(yaw / 2.0)
    tips = np.empty((len(robot.legs), frames, 4))
    for tip, offset, leg in zip(tips, robot.foot_offsets_m, robot.legs, strict=True):
        near = offset + rng.uniform(-0.15, 0.15, (frames, 2)) * robot.leg_m
        cos, sin = np.cos(yaw), np.sin(yaw)
        tip[:, 0] = qpos[:, 0] + cos * near[:, 0] - sin * near[:, 1]
        tip[:, 1] = qpos[:, 1] + sin * near[:, 0] + cos * near[:, 1]
        tip[:, 2] = leg.sole_m + rng.uniform(0.0, 0.1, frames) * robot.leg_m
        tip[:, 3] = yaw + rng.uniform(-0.2, 0.2, frames)
    return qpos, tips


def assert_feet_are_there(robot: RobotModel, qpos: np.ndarray, tips: np.ndarray, atol: float = 1e-6) -> None:
    for configuration, targets in zip(qpos, tips.transpose(1, 0, 2), strict=True):
        data = posed(robot.model, configuration)
        for leg, target in zip(robot.legs, targets, strict=True):
            np.testing.assert_allclose(leg.tip_place(data), target[:3], atol=atol)
            if leg.is_flat:
                axes = data.xmat[leg.foot].reshape(3, 3) @ leg.base_from_foot.T
                assert math.remainder(math.atan2(axes[1, 0], axes[0, 0]) - target[3], math.tau) == (
                    pytest.approx(0.0, abs=1e-5)
                )
                assert axes[2, 2] > 1.0 - 1e-9


def test_feet_reach_their_places(robot):
    qpos, tips = reachable_tips(robot, 40, np.random.default_rng(1))
    missed_m = LegSolver(robot).solve(qpos, tips)
    assert missed_m.shape == tips.shape[:2]
    assert missed_m.max() < 1e-6
    assert_feet_are_there(robot, qpos, tips)
    limited = robot.model.jnt_limited.astype(bool)
    angles = qpos[:, robot.model.jnt_qposadr[limited]]
    assert (angles >= robot.model.jnt_range[limited, 0]).all()
    assert (angles <= robot.model.jnt_range[limited, 1]).all()


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_round_trip_of_random_postures(seed, hexapod):
    """Where a leg's joints put its tip, the solver finds joints that put it there."""
    rng = np.random.default_rng(seed)
    robot, model = hexapod, hexapod.model
    qpos = np.tile(robot.rest_qpos, (3, 1))
    qpos[:, 7:] += rng.uniform(-0.3, 0.3, qpos[:, 7:].shape)
    tips = np.zeros((len(robot.legs), 3, 4))
    for frame, configuration in enumerate(qpos):
        data = posed(model, configuration)
        tips[:, frame, :3] = [leg.tip_place(data) for leg in robot.legs]
    found = np.tile(robot.rest_qpos, (3, 1))
    assert LegSolver(robot).solve(found, tips).max() < 1e-6
    np.testing.assert_allclose(found, qpos, atol=1e-4)


def test_agrees_with_a_plain_least_squares_solver(humanoid):
    """The same minimum as scipy's, started from the same posture, with MuJoCo's kinematics."""
    qpos, tips = reachable_tips(humanoid, 3, np.random.default_rng(2))
    plain = qpos.copy()
    LegSolver(humanoid).solve(qpos, tips)
    for frame, configuration in enumerate(plain):
        for leg, target in zip(humanoid.legs, tips[:, frame], strict=True):
            address = humanoid.model.jnt_qposadr[list(leg.joints)]
            solution = least_squares(_errors, configuration[address], args=(humanoid, configuration, leg, target))
            configuration[address] = solution.x
    np.testing.assert_allclose(qpos, plain, atol=1e-4)


def _errors(joints, robot, configuration, leg, target) -> np.ndarray:
    qpos = configuration.copy()
    qpos[robot.model.jnt_qposadr[list(leg.joints)]] = joints
    data = posed(robot.model, qpos)
    turned = np.zeros(3)
    wanted, found = np.zeros(4), np.zeros(4)
    mujoco.mju_axisAngle2Quat(wanted, np.array([0.0, 0.0, 1.0]), target[3])
    mujoco.mju_mat2Quat(found, data.xmat[leg.foot])
    mujoco.mju_subQuat(turned, wanted, found)
    return np.concatenate([target[:3] - leg.tip_place(data), 0.1 * turned])


def test_joints_that_count_from_another_zero_reach_their_places(tmp_path):
    """MJCF's ``ref``: the value of a joint in the posture that the file draws."""
    text = quadruped_mjcf().replace('<joint armature="0.01"', '<joint ref="0.2" armature="0.01"')
    (tmp_path / "robot.xml").write_text(text)
    robot = RobotModel.load(tmp_path / "robot.xml")
    assert (robot.model.qpos0[7:] == 0.2).all()
    qpos, tips = reachable_tips(robot, 20, np.random.default_rng(1))
    LegSolver(robot).solve(qpos, tips)
    assert_feet_are_there(robot, qpos, tips)


def test_a_frame_depends_on_itself_alone(robot):
    qpos, tips = reachable_tips(robot, 6, np.random.default_rng(3))
    alone = qpos[3:4].copy()
    LegSolver(robot).solve(qpos, tips)
    LegSolver(robot).solve(alone, tips[:, 3:4])
    np.testing.assert_allclose(alone[0], qpos[3], atol=1e-9)


def test_smooth_references_give_smooth_joints(robot):
    times = np.linspace(0.0, 2.0, 101)
    qpos = np.tile(robot.rest_qpos, (101, 1))
    qpos[:, 2] *= 0.94
    tips = np.zeros((len(robot.legs), 101, 4))
    for tip, offset, leg in zip(tips, robot.foot_offsets_m, robot.legs, strict=True):
        tip[:, :2], tip[:, 2] = offset, leg.sole_m
        tip[:, 0] += 0.2 * robot.leg_m * np.sin(2.0 * np.pi * times)
    LegSolver(robot).solve(qpos, tips)
    assert np.abs(np.diff(qpos, n=2, axis=0)).max() < 0.01


def test_foot_out_of_reach_gets_the_nearest_posture(robot):
    qpos = np.tile(robot.rest_qpos, (1, 1))
    tips = np.zeros((len(robot.legs), 1, 4))
    tips[:, 0, :2] = robot.foot_offsets_m
    tips[:, 0, 2] = -2.0 * robot.leg_m
    missed_m = LegSolver(robot).solve(qpos, tips)
    assert (missed_m > robot.leg_m).all()
    assert np.isfinite(qpos).all()
    data = posed(robot.model, qpos[0])
    for leg, tip, missed in zip(robot.legs, tips[:, 0], missed_m[:, 0], strict=True):
        assert np.linalg.norm(leg.tip_place(data) - tip[:3]) == pytest.approx(missed, abs=1e-9)
        # Stretched towards it: nearer than the resting foot.
        assert missed < np.linalg.norm(leg.tip_place(posed(robot.model, robot.rest_qpos)) - tip[:3])


def test_leg_of_five_joints_keeps_its_foot_in_place_and_yaw(shared_robot):
    """H1 has no ankle roll: its sole tilts sideways a little, but does not slide or twist."""
    robot = RobotModel.load(shared_robot("h1/h1/h1.xml"), ["pelvis", [0, 0, 0.7], [0, 0, 0], 60])
    qpos, tips = reachable_tips(robot, 20, np.random.default_rng(4))
    tips[..., 3] = 2.0 * np.arctan2(qpos[:, 6], qpos[:, 3])
    assert LegSolver(robot).solve(qpos, tips).max() < 1e-3
    for frame, configuration in enumerate(qpos):
        data = posed(robot.model, configuration)
        for leg in robot.legs:
            axes = data.xmat[leg.foot].reshape(3, 3)
            assert math.degrees(math.acos(axes[2, 2])) < 12.0
            turned = math.remainder(math.atan2(axes[1, 0], axes[0, 0]) - tips[0, frame, 3], math.tau)
            assert abs(math.degrees(turned)) < 3.0

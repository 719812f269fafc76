"""Footsteps of two, four and six legs: planted feet rest, swings clear, groups take turns."""

from __future__ import annotations

import math
from dataclasses import MISSING, fields

import numpy as np
import pytest

from r2sego_blender.robot.behaviours.trajectory import RATE_HZ, RootTrajectory
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.motion.gait import Gait, plan_gait

ROBOTS = ("humanoid", "quadruped", "hexapod")


@pytest.fixture(params=ROBOTS)
def robot(request) -> RobotModel:
    return request.getfixturevalue(request.param)


def walk(speed_m_s: float, turn_rad_s: float, seconds: float = 6.0) -> RootTrajectory:
    """A circle walked from rest."""
    times = np.arange(round(seconds * RATE_HZ) + 1) / RATE_HZ
    rise = np.clip(times, 0.0, 1.0) * np.clip(seconds - times, 0.0, 1.0)
    speed, yaw = speed_m_s * rise, np.cumsum(turn_rad_s * rise) / RATE_HZ + 0.4
    heading = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    xy = np.cumsum(speed[:, None] * heading, axis=0) / RATE_HZ
    given = {"behaviour": "walk_to", "xy": xy, "yaw": yaw, "speed": speed, "goal": xy[-1]}
    required = [field.name for field in fields(RootTrajectory) if field.default is MISSING]
    return RootTrajectory(**({name: np.zeros(len(times)) for name in required} | given))


def swinging(gait: Gait) -> np.ndarray:
    return gait.feet[..., 2] > 1e-9


@pytest.mark.parametrize(("speed", "turn"), [(0.5, 0.0), (0.7, 0.8), (0.0, 1.4)])
def test_planted_feet_do_not_move_at_all(robot, speed, turn):
    gait = plan_gait(walk(speed, turn), robot)
    assert gait.feet.shape == (len(robot.legs), 301, 4)
    up = swinging(gait)
    assert up.any(axis=1).all()
    for foot, lifted in zip(gait.feet, up, strict=True):
        resting = ~lifted[1:] & ~lifted[:-1]
        np.testing.assert_array_equal(np.diff(foot, axis=0)[resting], 0.0)


@pytest.mark.parametrize(("speed", "turn"), [(0.5, 0.0), (0.7, 0.8), (0.0, 1.4)])
def test_loads_follow_the_feet_on_the_floor(robot, speed, turn):
    gait = plan_gait(walk(speed, turn), robot)
    np.testing.assert_allclose(gait.load.sum(axis=0), 1.0)
    assert (gait.load >= 0.0).all()
    assert np.abs(gait.load[swinging(gait)]).max() < 1e-9
    # A load goes over from foot to foot; it does not jump.
    assert np.abs(np.diff(gait.load, axis=1)).max() < 0.5


def test_one_group_swings_while_the_other_stands(robot):
    gait = plan_gait(walk(0.5, 0.0), robot)
    groups = np.array([leg.group for leg in robot.legs])
    up = swinging(gait)
    assert set(groups) == {0, 1}
    assert not (up[groups == 0].any(axis=0) & up[groups == 1].any(axis=0)).any()
    middle = up[:, 100:200]
    for group in (0, 1):  # at full speed the legs of a group go together
        np.testing.assert_array_equal(
            middle[groups == group], middle[groups == group][:1].repeat((groups == group).sum(), axis=0)
        )


def test_feet_stay_below_the_body_whatever_the_robot_s_size(robot):
    root = walk(0.6, 0.5)
    gait = plan_gait(root, robot)
    cos, sin = np.cos(root.yaw), np.sin(root.yaw)
    for foot, offset in zip(gait.feet, robot.foot_offsets_m, strict=True):
        under = root.xy + np.stack([cos * offset[0] - sin * offset[1], sin * offset[0] + cos * offset[1]], axis=1)
        assert np.linalg.norm(foot[:, :2] - under, axis=1).max() < 0.6 * robot.leg_m
    assert gait.feet[..., 2].max() <= 0.15 * robot.leg_m + 1e-9
    assert gait.feet[..., 2].max() > 0.01


def test_feet_end_up_under_a_body_that_stops(robot):
    root = walk(0.5, 0.3)
    gait = plan_gait(root, robot)
    cos, sin = math.cos(root.yaw[-1]), math.sin(root.yaw[-1])
    turn = np.array([[cos, -sin], [sin, cos]])
    missed = gait.feet[:, -1, :2] - (root.xy[-1] + robot.foot_offsets_m @ turn.T)
    assert np.linalg.norm(missed, axis=1).max() < 0.06


def test_standing_robot_keeps_its_feet(robot):
    gait = plan_gait(walk(0.0, 0.0), robot)
    assert not swinging(gait).any()
    np.testing.assert_array_equal(gait.feet, gait.feet[:, :1].repeat(301, axis=1))
    np.testing.assert_allclose(gait.load, 1.0 / len(robot.legs))


def test_biped_sways_over_the_foot_that_stands(humanoid):
    gait = plan_gait(walk(0.5, 0.0), humanoid)
    left_only, right_only = gait.load[0] > 1.0 - 1e-9, gait.load[1] > 1.0 - 1e-9
    assert gait.sway_m[left_only].mean() > 0.01
    assert gait.sway_m[right_only].mean() < -0.01


def test_wheeled_robot_has_no_steps(wheeled):
    gait = plan_gait(walk(0.5, 0.3), wheeled)
    assert gait.feet.shape == (0, 301, 4)
    assert not gait.sway_m.any()
    assert not gait.bob_m.any()

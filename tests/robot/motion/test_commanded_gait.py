"""Footsteps of what is commanded as it goes on: planted feet rest, groups take turns, standing ends under the base."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.robot.behaviours.trajectory import RATE_HZ
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.motion.commanded_base import CommandedBase
from r2sego_blender.robot.motion.commanded_gait import CommandedGait
from r2sego_blender.robot.motion.dynamics import FrameDynamics, inverse_dynamics, velocities
from r2sego_blender.robot.motion.gait import Gait

FASTEST, ACCELERATIONS = (0.6, 0.2, 0.9), (0.7, 0.7, 2.0)
VELOCITY = st.tuples(st.floats(-0.3, 0.6), st.floats(-0.2, 0.2), st.floats(-0.9, 0.9))


def walked(robot: RobotModel, commands) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Base (T, 3), feet (T, L, 4) and loads (T, L) of ``commands``: velocity and seconds each, from standing."""
    base, gait = CommandedBase(ACCELERATIONS), CommandedGait(robot, FASTEST)
    base.start(0.3, -0.2, 0.7)
    gait.start(0.3, -0.2, 0.7)
    places, feet, loads = [], [], []
    for wanted, seconds in commands:
        for _ in range(round(seconds * RATE_HZ)):
            base.advance(wanted, (base.x, base.y, base.yaw))
            gait.advance(base, wanted)
            places.append((base.x, base.y, base.yaw))
            feet.append(gait.feet.copy())
            loads.append(gait.load)
    return np.array(places), np.array(feet), np.array(loads)


@pytest.mark.parametrize("name", ["humanoid", "quadruped", "hexapod"])
def test_feet_rest_and_take_turns_whatever_is_commanded(name, request):
    robot = request.getfixturevalue(name)
    groups = np.array([leg.group for leg in robot.legs])

    @settings(max_examples=20, deadline=None)
    @given(st.lists(st.tuples(VELOCITY, st.floats(0.1, 1.5)), min_size=1, max_size=5))
    def holds(commands):
        base, feet, load = walked(robot, [*commands, ((0.0, 0.0, 0.0), 2.5)])
        up = feet[..., 2] > 1e-9
        rests = ~up[1:] & ~up[:-1]
        assert np.abs(np.diff(feet, axis=0)[rests]).max() < 1e-12
        assert not (up[:, groups == 0].any(axis=1) & up[:, groups == 1].any(axis=1)).any()
        np.testing.assert_allclose(load.sum(axis=1), 1.0)
        assert load[up].max(initial=0.0) < 1e-6
        assert np.linalg.norm(np.diff(feet[..., :2], axis=0), axis=2).max() * RATE_HZ < 6.0  # no jump
        acceleration = np.diff(base, n=2, axis=0) * RATE_HZ**2
        turning = 1.1 * FASTEST[2] * np.hypot(*FASTEST[:2])  # a base that turns as it goes
        assert np.linalg.norm(acceleration[:, :2], axis=1).max(initial=0.0) < np.hypot(*ACCELERATIONS[:2]) + turning
        # It ends at rest, its feet where they stand beneath the base.
        assert not up[-1].any()
        cos, sin = np.cos(base[-1, 2]), np.sin(base[-1, 2])
        under = base[-1, :2] + robot.foot_offsets_m @ np.array([[cos, sin], [-sin, cos]])
        assert np.linalg.norm(feet[-1, :, :2] - under, axis=1).max() < 0.016

    holds()


def test_dynamics_of_a_frame_are_those_of_the_motion(humanoid):
    """With the same accelerations the torques are the same."""
    frames = 5
    rng = np.random.default_rng(0)
    qpos = np.tile(humanoid.rest_qpos, (frames, 1))
    qpos[:, 7:] += 0.01 * rng.normal(size=(1, humanoid.model.nq - 7)) * np.arange(frames)[:, None]
    offsets = humanoid.foot_offsets_m
    feet = np.zeros((2, frames, 4))
    feet[..., :2] = offsets[:, None]
    still = np.zeros(frames)
    gait = Gait(feet, np.full((2, frames), 0.5), still, still, still)
    qvel, torque = inverse_dynamics(humanoid, qpos, gait, 0.0)
    np.testing.assert_array_equal(qvel, velocities(humanoid.model, qpos))
    one = FrameDynamics(humanoid, 0.0)
    # In the middle of a motion of constant velocity there is no acceleration.
    found = one.torque(qpos[2], qvel[2], np.zeros(humanoid.model.nv), feet[:, 2], np.array([0.5, 0.5]), 1.0)
    np.testing.assert_allclose(found, torque[2], atol=1e-6)

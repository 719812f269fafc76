"""Four numbers command the drive within its limits, and every command of a teacher has its four numbers."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.config.settings import RolloutSettings
from r2sego_blender.policy.action_spaces.slot import action_space
from r2sego_blender.robot.controllers.commanded_drive import DriveCommand, DriveLimits
from r2sego_blender.robot.controllers.drive_actions import action_of, command_of
from r2sego_blender.robot.model.model import RobotModel

LIMITS = DriveLimits(vx_m_s=(-0.2, 0.8), vy_m_s=(-0.1, 0.3), yaw_rate_rad_s=(-0.5, 1.0))
ROOM = '<mujoco><worldbody><geom name="floor" type="plane" size="5 5 1"/></worldbody></mujoco>'


def test_one_is_the_limit_on_each_side_and_zero_stands():
    assert command_of(np.array([1, 1, 1, 1]), LIMITS) == DriveCommand(0.8, 0.3, 1.0, True)
    assert command_of(np.array([-1, -1, -1, -1]), LIMITS) == DriveCommand(-0.2, -0.1, -0.5, False)
    assert command_of(np.zeros(4), LIMITS) == DriveCommand(0.0, 0.0, 0.0, False)
    assert command_of(np.array([0.5, -0.5, 7.0, 0.01]), LIMITS) == DriveCommand(0.4, -0.05, 1.0, True)


@given(st.floats(-0.2, 0.8), st.floats(-0.1, 0.3), st.floats(-0.5, 1.0), st.booleans())
def test_a_command_comes_back_from_its_action(vx, vy, rate, sit):
    action = action_of(DriveCommand(vx, vy, rate, sit), LIMITS)
    again = command_of(action, LIMITS)
    assert action.dtype == np.float32 and np.abs(action).max() <= 1.0 and again.sit == sit
    assert (again.vx_m_s, again.vy_m_s, again.yaw_rate_rad_s) == pytest.approx((vx, vy, rate), abs=1e-6)


def test_the_robot_goes_ahead_at_the_commanded_speed(tmp_path):
    (tmp_path / "room.xml").write_text(ROOM)
    space, robot = action_space("commands"), RobotModel.load()
    composition = space.composition(robot, tmp_path / "room.xml", RolloutSettings())
    drive = space.make(robot, composition, 0.0)
    data = mujoco.MjData(composition.model)
    data.qpos[:] = drive.start(np.zeros(2), 0.6)
    drive.act(np.array([0.5, 0.0, 0.0, -1.0]))
    for step in range(round(2.0 / composition.model.opt.timestep)):
        drive.apply(data, step)
        mujoco.mj_step(composition.model, data)
    along = data.qpos[:2] @ [np.cos(0.6), np.sin(0.6)]
    assert 0.3 < along < 0.62 and abs(data.qpos[:2] @ [-np.sin(0.6), np.cos(0.6)]) < 0.08

"""Wheels that roll without slipping under a moving base."""

from __future__ import annotations

import numpy as np

from ..model.model import RobotModel
from .navigation import RATE_HZ


def roll_wheels(robot: RobotModel, qpos: np.ndarray, yaw: np.ndarray) -> None:
    """Write the wheels' angles into ``qpos`` (T, nq) in place, for the base's path in it.

    ``yaw`` (T,) radians is the base's heading, not wrapped. Only motion along the heading
    turns a wheel: what goes sideways slips.
    """
    velocity = np.gradient(qpos[:, :2], 1.0 / RATE_HZ, axis=0)
    forward_m_s = velocity[:, 0] * np.cos(yaw) + velocity[:, 1] * np.sin(yaw)
    rate = np.gradient(yaw, 1.0 / RATE_HZ)
    for wheel in robot.wheels:
        rim_m_s = forward_m_s - rate * wheel.offset_m[1]
        rolled_m = np.concatenate([[0.0], np.cumsum(0.5 * (rim_m_s[1:] + rim_m_s[:-1])) / RATE_HZ])
        qpos[:, robot.model.jnt_qposadr[wheel.joint]] += wheel.forward * rolled_m / wheel.radius_m

"""Velocity commands and a word to sit: the embedded action space, carried out by the commanded drive."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from ...config.settings import RolloutSettings
from ...robot.controllers.commanded_drive import CommandedDrive, DriveCommand, DriveLimits
from ...robot.model.composition import Composition, compose
from ...robot.model.model import RobotModel

BACKENDS = {"commands": "embedded: velocity commands, and to sit"}
ORDER = 0

SIZE = 4
"""Ahead, left and turning left, as shares of the drive's limits; above 0 the last says to sit."""

RATE_HZ = 10.0


def command_of(action: np.ndarray, limits: DriveLimits = DriveLimits()) -> DriveCommand:
    """What ``action`` (4,) in [-1, 1] says: 1 is the upper limit, -1 the lower one, 0 stands still."""
    shares = np.clip(np.asarray(action, np.float64), -1.0, 1.0)
    vx, vy, rate = (
        float(share) * (high if share > 0.0 else -low)
        for share, (low, high) in zip(shares[:3], _ranges(limits), strict=True)
    )
    return DriveCommand(vx, vy, rate, sit=bool(shares[3] > 0.0))


def action_of(command: DriveCommand, limits: DriveLimits = DriveLimits()) -> np.ndarray:
    """(4,) float32 in [-1, 1], the action that says ``command``; what is beyond the limits says them."""
    wanted = command.vx_m_s, command.vy_m_s, command.yaw_rate_rad_s
    shares = [
        value / (high if value > 0.0 else -low) for value, (low, high) in zip(wanted, _ranges(limits), strict=True)
    ]
    return np.clip([*shares, 1.0 if command.sit else -1.0], -1.0, 1.0).astype(np.float32)


def composition(robot: RobotModel, collision_mjcf: Path, settings: RolloutSettings) -> Composition:
    """See ``slot.ActionSpace``: the robot's own servos, and the helping wrench."""
    return compose(robot, collision_mjcf, settings)


def make(robot: RobotModel, composition: Composition, floor_z_m: float, **_: Any) -> CommandsDrive:
    """See ``slot.ActionSpace``."""
    return CommandsDrive(CommandedDrive(robot, composition, floor_z_m))


class CommandsDrive:
    """Serves ``slot.ActionDrive``; ``drive`` is what it commands."""

    def __init__(self, drive: CommandedDrive) -> None:
        self.drive = drive

    def start(self, place_m: np.ndarray, heading_rad: float) -> np.ndarray:
        """See ``slot.ActionDrive``."""
        return self.drive.start(place_m, heading_rad)

    def act(self, action: np.ndarray) -> None:
        """See ``slot.ActionDrive``. Raises RobotError as ``CommandedDrive.command``."""
        self.drive.command(command_of(action, self.drive.limits))

    def apply(self, data: mujoco.MjData, step: int) -> None:
        """See ``slot.ActionDrive``."""
        self.drive.apply(data, step)


def _ranges(limits: DriveLimits) -> tuple[tuple[float, float], ...]:
    return limits.vx_m_s, limits.vy_m_s, limits.yaw_rate_rad_s

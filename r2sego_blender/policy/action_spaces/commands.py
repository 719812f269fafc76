"""Velocity commands and a word to sit: the embedded action space, carried out by the commanded drive."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from ...config.settings import RolloutSettings
from ...robot.controllers import drive_actions
from ...robot.controllers.commanded_drive import CommandedDrive
from ...robot.model.composition import Composition, compose
from ...robot.model.model import RobotModel

BACKENDS = {"commands": "embedded: velocity commands, and to sit"}
ORDER = 0

SIZE = drive_actions.SIZE
"""See ``drive_actions``, which says what they mean."""

RATE_HZ = 10.0


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
        self.drive.command(drive_actions.command_of(action, self.drive.limits))

    def apply(self, data: mujoco.MjData, step: int) -> None:
        """See ``slot.ActionDrive``."""
        self.drive.apply(data, step)

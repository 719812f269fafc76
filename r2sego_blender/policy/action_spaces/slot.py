"""The slot of the action space: numbers from -1 to 1 in, the robot's controls out.

A space is a file of this folder with what ``ActionSpace`` lists, beside ``BACKENDS``, its name and what people are
shown for it (``config.slots``); nothing else has to know of it.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any, Protocol, cast

import mujoco
import numpy as np

from ...config.settings import RolloutSettings
from ...config.slots import ACTION_SPACES
from ...robot.model.composition import Composition
from ...robot.model.model import RobotModel


class ActionDrive(Protocol):
    """What carries actions out in one simulation."""

    def start(self, place_m: np.ndarray, heading_rad: float) -> np.ndarray:
        """(nq,) float64 of the robot standing at ``place_m`` (2,) of the world, facing ``heading_rad``.

        What an earlier attempt left is forgotten.
        """
        ...

    def act(self, action: np.ndarray) -> None:
        """From now on ``action`` (SIZE,) is wanted; what lies beyond [-1, 1] is taken for its bound."""
        ...

    def apply(self, data: mujoco.MjData, step: int) -> None:
        """Write the controls of simulation step ``step`` into ``data``."""
        ...


class ActionSpace(Protocol):
    """A file of this folder, as ``action_space`` gives it.

    ``SIZE`` numbers, each from -1 to 1, are an action; one is taken ``RATE_HZ`` times a second.
    """

    SIZE: int
    RATE_HZ: float

    def composition(self, robot: RobotModel, collision_mjcf: Path, settings: RolloutSettings) -> Composition:
        """The robot in the room with the servos that the space's drive wants. Raises RobotError."""
        ...

    def make(self, robot: RobotModel, composition: Composition, floor_z_m: float, **given: Any) -> ActionDrive:
        """What carries actions out in ``composition``, on a floor of that height; ``given`` is the space's own.

        Raises RobotError.
        """
        ...


def action_space(name: str) -> ActionSpace:
    """The space that the slot calls ``name``, one of ``ACTION_SPACES.labels``."""
    return cast(ActionSpace, importlib.import_module(f".{ACTION_SPACES.module(name)}", __package__))

"""What the loop asks of an environment and of a teacher. Needs NumPy alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from ...robot.controllers.commanded_drive import DriveCommand
from ..environment.state import PrivilegedState

Observation = Mapping[str, np.ndarray]
"""``head`` (96, 128, 3) uint8 sRGB, and ``proprio`` (P,) float32."""


class Environment(Protocol):
    """Episodes, each given by its seed."""

    def reset(self, seed: int) -> tuple[Observation, PrivilegedState]:
        """Begin episode ``seed``."""

    def view(self, seed: int, near_target: bool) -> tuple[Observation, PrivilegedState]:
        """Begin episode ``seed`` facing anywhere, or near the target: for what is seen from there."""

    def step(self, action: np.ndarray) -> tuple[Observation, PrivilegedState, bool]:
        """Do ``action`` (4,) float32 in [-1, 1] for a tenth of a second; the last says that the episode is over.

        It has succeeded where the state at its end has no ``failure``.
        """


class Teacher(Protocol):
    """Says what to do in any state."""

    def label(self, state: PrivilegedState, phase: Any = None) -> tuple[DriveCommand, Any]:
        """The command in ``state``, and what to give with the state that follows; None for the first."""

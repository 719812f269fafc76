"""A toy to act in: turn until a red dot is in the middle of the picture, then sit down."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from r2sego_blender.policy.environment.state import PrivilegedState
from r2sego_blender.robot.controllers.commanded_drive import DriveCommand

_STEP_RAD = 0.25  # a step's turn at a full command
_ALIGNED_RAD = 0.12
_VIEW_RAD = 0.9
_STEPS = 12


class DotEnvironment:
    """Begins with the dot to the left; ``hue`` is the channel of the dot, and all that pictures differ in."""

    def __init__(self, hue: int = 0) -> None:
        self._hue = hue

    def reset(self, seed: int) -> tuple[dict[str, np.ndarray], PrivilegedState]:
        self._rng = np.random.default_rng(seed)
        self._bearing, self._failure, self._count = self._rng.uniform(0.25, 0.8), "", 0
        self._seated = False
        return self._observation(), self._state()

    def view(self, seed: int, near_target: bool) -> tuple[dict[str, np.ndarray], PrivilegedState]:
        return self.reset(seed)

    def step(self, action: np.ndarray) -> tuple[dict[str, np.ndarray], PrivilegedState, bool]:
        assert action.shape == (4,)
        assert np.abs(action).max() <= 1.0
        self._count += 1
        if action[3] > 0.0:
            self._seated = True
            self._failure = "" if abs(self._bearing) < _ALIGNED_RAD else "missed_target"
        else:
            self._bearing -= _STEP_RAD * float(action[2]) * self._rng.uniform(0.9, 1.1)
            self._failure = "time_out" if self._count == _STEPS else ""
        return self._observation(), self._state(), self._seated or bool(self._failure)

    def _observation(self) -> dict[str, np.ndarray]:
        picture = np.full((96, 128, 3), 90, np.uint8)
        column = round(64 - 64 * self._bearing / _VIEW_RAD)
        picture[40:56, max(0, column - 8) : max(0, column + 8), self._hue] = 250
        return {"head": picture, "proprio": np.array([self._count / _STEPS, 1.0], np.float32)}

    def _state(self) -> PrivilegedState:
        goal = np.array([2.0, 0.0])  # in the world the robot turns, and the dot stays
        return PrivilegedState(
            np.zeros(2), -self._bearing, 0.7, None, goal, self._seated, 0.0, 0.1 * self._count, 3.0, self._failure
        )


class DotTeacher:
    """Turns to the dot, and sits once it is ahead."""

    def label(self, state: PrivilegedState, phase: Any = None) -> tuple[DriveCommand, Any]:
        bearing = math.atan2(state.goal_xy_m[1], state.goal_xy_m[0]) - state.yaw_rad
        rate = 0.9 * max(-1.0, min(1.0, bearing / _STEP_RAD))
        return DriveCommand(0.0, 0.0, rate, abs(bearing) < 0.6 * _ALIGNED_RAD), None

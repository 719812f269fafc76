"""Footsteps under a commanded base: the rules of ``gait``, with no more known than is past."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from ..behaviours.trajectory import RATE_HZ
from ..model.model import RobotModel
from .commanded_base import CommandedBase
from .gait import (
    BOB_M,
    DOUBLE_SUPPORT,
    FULL_SPEED_M_S,
    MIN_STEP_M,
    MIN_STEP_RAD,
    SWAY_M,
    step_clearance_m,
    step_seconds,
)

_DT = 1.0 / RATE_HZ
# In the last part of a swing the foothold stays, so that the foot lands at rest.
_AIMS = 0.7
_EFFORT_S = 0.2


class CommandedGait:
    """Steps of the two groups of legs in turn, frame by frame at ``RATE_HZ``.

    A step begins where a foot is not where the base will be in the middle of its next stance:
    who stands still does not step. ``feet`` (L, 4), ``load`` (L,), ``sway_m``, ``bob_m`` and
    ``swing`` are those of a ``gait.Gait`` now.
    """

    def __init__(self, robot: RobotModel, fastest: Sequence[float]) -> None:
        self._offsets = robot.foot_offsets_m
        self._groups = np.array([leg.group for leg in robot.legs], int)
        if robot.legs:
            self._leg_m = robot.leg_m
            self._radius_m = float(np.linalg.norm(self._offsets, axis=1).max())
            self._step_s = step_seconds(math.hypot(fastest[0], fastest[1]) + fastest[2] * self._radius_m, self._leg_m)
            self._clearance_m = step_clearance_m(self._leg_m)
            self._aside = self._offsets[:, 1] / np.abs(self._offsets[:, 1]).max()
            self._support_s = DOUBLE_SUPPORT * self._step_s
            self._swayed: deque[float] = deque(maxlen=max(1, round(self._support_s * RATE_HZ)))
        self.start(0.0, 0.0, 0.0)

    def start(self, x: float, y: float, yaw: float) -> None:
        """Stand there, the feet under the base."""
        count = len(self._groups)
        self.feet = self._under((x, y, yaw))
        self._lifted, self._landing = self.feet.copy(), self.feet.copy()
        self._lift = np.zeros(count)
        self.load = np.full(count, 1.0 / max(count, 1))
        self.sway_m = self.bob_m = self.swing = 0.0
        self._swinging, self._last = -1, 1
        self._at_s = self._effort = 0.0
        if count:
            self._swayed.clear()
            self._swayed.extend([0.0] * (self._swayed.maxlen or 1))

    @property
    def stands(self) -> bool:
        """Whether all feet stand, and carry their part."""
        return self._swinging < 0 and not self._lift.any()

    def advance(self, base: CommandedBase, wanted: Sequence[float]) -> None:
        """One frame under ``base``, for the ``wanted`` velocity (3,)."""
        if not len(self._groups):
            return
        if self._swinging < 0:
            self._begin(base, wanted)
        else:
            self._at_s += _DT
            if self._at_s >= self._step_s - 1e-9:
                self._last, self._swinging = self._swinging, -1
                self._begin(base, wanted)
        swings = self._groups == self._swinging
        if self._swinging >= 0:
            self._swing(base, wanted, swings)
        ramp = _DT / self._support_s
        self._lift += np.minimum(np.maximum(swings - self._lift, -ramp), ramp)
        load = np.maximum(1.0 - self._lift, 1e-9)
        self.load = load / load.sum()
        self._swayed.append(SWAY_M * float(self._aside @ self.load))
        self.sway_m = sum(self._swayed) / len(self._swayed)
        speed = min(1.0, abs(base.velocity[0]) / FULL_SPEED_M_S)
        self._effort += (speed - self._effort) * _DT / _EFFORT_S
        # A step of the even group is the even one of ``gait``; here it begins as its weight shifts.
        group = self._last if self._swinging < 0 else self._swinging
        steps = group + (self._at_s - 0.5 * self._support_s) / self._step_s
        self.bob_m = -BOB_M * math.cos(math.tau * steps) * self._effort - self._lowered_m(base)
        self.swing = -math.cos(math.pi * steps) * self._effort

    def _lowered_m(self, base: CommandedBase) -> float:
        """How far the base goes down for legs at the ends of their stances to be no longer than at rest."""
        vx, vy, rate = base.velocity
        foot_m_s = math.hypot(vx, vy) + abs(rate) * self._radius_m
        stray_m = 0.5 * (self._step_s + self._support_s) * foot_m_s
        return stray_m**2 / (2.0 * self._leg_m)

    def _begin(self, base: CommandedBase, wanted: Sequence[float]) -> None:
        """Begin the next group's step where it, or else the other's, has somewhere to go."""
        goal = self._under(base.ahead(wanted, 1.5 * self._step_s + 0.5 * self._support_s))
        moved = goal - self.feet
        far = (np.hypot(moved[:, 0], moved[:, 1]) > MIN_STEP_M) | (np.abs(moved[:, 3]) > MIN_STEP_RAD)
        for group in (1 - self._last, self._last):
            if far[self._groups == group].any():
                self._swinging, self._at_s = group, 0.0
                self._lifted[:] = self._landing[:] = self.feet
                return

    def _swing(self, base: CommandedBase, wanted: Sequence[float], swings: np.ndarray) -> None:
        swing_s = self._step_s - self._support_s
        phase = min(max((self._at_s + _DT - self._support_s) / swing_s, 0.0), 1.0)
        if phase == 0.0:
            return
        if phase < _AIMS:
            left_s = (1.0 - phase) * swing_s + 0.5 * (self._step_s + self._support_s)
            self._landing[swings] = self._under(base.ahead(wanted, left_s))[swings]
        moved = phase**3 * (10.0 - 15.0 * phase + 6.0 * phase**2)
        self.feet[swings] = (self._lifted + moved * (self._landing - self._lifted))[swings]
        self.feet[swings, 2] = self._clearance_m * math.sin(math.pi * phase) ** 2

    def _under(self, pose: tuple[float, float, float]) -> np.ndarray:
        """(L, 4) feet under a base at ``pose``: x, y, yaw."""
        x, y, yaw = pose
        cos, sin = math.cos(yaw), math.sin(yaw)
        feet = np.zeros((len(self._groups), 4))
        feet[:, 0] = x + cos * self._offsets[:, 0] - sin * self._offsets[:, 1]
        feet[:, 1] = y + sin * self._offsets[:, 0] + cos * self._offsets[:, 1]
        feet[:, 3] = yaw
        return feet

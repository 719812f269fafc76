"""Sitting down without knowing on what: back, then down, until a support carries weight; and up again."""

from __future__ import annotations

import math
from enum import Enum, auto

import numpy as np

from ..behaviours.trajectory import RATE_HZ, REACH_RAD, STAND_OFF_M, STILL_S
from ..model.contacts import SEATED_LOAD
from ..model.leg_tracker import LegTracker
from ..model.model import RobotModel

_DT = 1.0 / RATE_HZ
# From the seat's front edge to the seated pelvis, where the legs are long enough; the middle
# of what the planner draws, as are the lean and the rates.
_DEPTH_M = 0.12
_LEAN_RAD = math.radians(24.0)
_BACK_M_S, _DOWN_M_S, _ACCELERATION_M_S2 = 0.3, 0.22, 0.8
_TURN_RAD_S, _TURN_RAD_S2 = 0.8, 3.0
# It goes down once it is this far back, or something holds it.
_FAR_BACK = 0.75
# Shares of the weight: who touches a support goes no farther back, and is seated on it.
_TOUCHED_LOAD, _RESTING_LOAD = 0.05, 0.6
_UNLOADING_PER_S = 2.5
# Held by something, the reference goes no farther from the real base than this, m.
_STRAYS_M = 0.02
# The reference presses this far into the seat.
_PRESS_M = 0.003
# A foot that misses its place by more is out of reach.
_REACH_M = 0.005
_STEP_M = 0.01


class Phase(Enum):
    """What the body does."""

    UPRIGHT = auto()
    LOWERING = auto()
    SEATED = auto()
    RISING = auto()


class _Moved:
    """A quantity that goes to where it is told, with a bounded rate and acceleration."""

    def __init__(self, rate: float, acceleration: float) -> None:
        self._rate, self._acceleration = rate, acceleration
        self.value = self.rate = 0.0

    def advance(self, target: float) -> None:
        left = target - self.value
        # The last part of the way takes a frame at least.
        wanted = min(self._rate, math.sqrt(1.6 * self._acceleration * abs(left)), abs(left) / (4.0 * _DT))
        change = math.copysign(wanted, left) - self.rate
        self.rate += min(max(change, -self._acceleration * _DT), self._acceleration * _DT)
        self.value += self.rate * _DT
        if abs(left) < 1e-4 and abs(self.rate) < 1e-3:
            self.value, self.rate = target, 0.0


class CommandedSitting:
    """How far the base of a robot that stands goes back and down.

    ``back_m`` and ``down_m`` from where it stands, ``lean_rad`` and ``reach_rad`` of waist and
    arms, forward; ``on_feet`` the share of the weight that the legs are to carry.
    """

    def __init__(self, robot: RobotModel, standing_m: float) -> None:
        self._back, self._down = _Moved(_BACK_M_S, _ACCELERATION_M_S2), _Moved(_DOWN_M_S, _ACCELERATION_M_S2)
        self._lean, self._reach = _Moved(_TURN_RAD_S, _TURN_RAD_S2), _Moved(_TURN_RAD_S, _TURN_RAD_S2)
        self._backs_m, self._needs_m, self._lowest_m = _reachable(robot, standing_m)
        self.start()

    def start(self) -> None:
        """Stand upright."""
        self.phase = Phase.UPRIGHT
        for one in (self._back, self._down, self._lean, self._reach):
            one.value = one.rate = 0.0
        self._unloaded, self._held_s = 0.0, 0.0

    @property
    def back_m(self) -> float:
        return self._back.value

    @property
    def down_m(self) -> float:
        return self._down.value

    @property
    def lean_rad(self) -> float:
        return self._lean.value

    @property
    def reach_rad(self) -> float:
        return self._reach.value

    @property
    def on_feet(self) -> float:
        return 1.0 - self._unloaded

    @property
    def is_upright(self) -> bool:
        """Whether it stands, or goes on standing up."""
        return self.phase is Phase.UPRIGHT

    def advance(self, sit: bool, stands: bool, touched: float, carried: float, real_m: tuple[float, float]) -> None:
        """One frame: whether to ``sit``, for a robot that ``stands`` on its feet or not yet.

        ``touched`` and ``carried``: what a support pushes, and lifts, as shares of the weight;
        ``real_m`` how far back and down the real base is.
        """
        if self.phase is Phase.UPRIGHT:
            self._held_s = self._held_s + _DT if sit and stands else 0.0
            if self._held_s < STILL_S:
                return
            self.phase = Phase.LOWERING
        if not sit and self.phase in (Phase.LOWERING, Phase.SEATED):
            self.phase = Phase.RISING
        elif sit and self.phase is Phase.RISING:
            self.phase = Phase.LOWERING
        elif self.phase is Phase.LOWERING and carried >= _RESTING_LOAD and self._unloaded >= 1.0:
            self.phase = Phase.SEATED
        elif self.phase is Phase.SEATED and carried < _TOUCHED_LOAD:
            self.phase = Phase.LOWERING
        self._move(touched, carried, *real_m)

    def _move(self, touched: float, carried: float, real_back_m: float, real_down_m: float) -> None:
        back_m, lowest_m = float(self._backs_m[-1]), self._lowest_m
        bears = min(max((carried - _TOUCHED_LOAD) / (SEATED_LOAD - _TOUCHED_LOAD), 0.0), 1.0)
        if self.phase is Phase.LOWERING:
            blocked = self._back.value > real_back_m + _STRAYS_M
            held = blocked or touched > _TOUCHED_LOAD
            goes_down = held or self._back.value > _FAR_BACK * back_m
            if blocked:  # what stops the robot stops the reference as hard
                self._back.rate = min(self._back.rate, 0.0)
            self._back.advance(min(self._back.value, real_back_m + 0.5 * _STRAYS_M) if held else back_m)
            if held and self._down.value > real_down_m + _STRAYS_M:
                self._down.rate = min(self._down.rate, 0.0)
            deepest_m = min(lowest_m, real_down_m + _STRAYS_M) if held else lowest_m
            self._down.advance(deepest_m if goes_down else self._needed())
            lean, reach = _LEAN_RAD, REACH_RAD
        elif self.phase is Phase.SEATED:
            bears = 1.0
            self._back.advance(max(real_back_m, 0.0))
            self._down.advance(min(real_down_m + _PRESS_M, lowest_m))
            lean, reach = 0.0, REACH_RAD
        else:
            bears = 0.0
            is_high = self._down.value < 0.5 * lowest_m
            self._down.advance(self._needed())
            self._back.advance(0.0 if is_high else self._back.value)
            lean, reach = _LEAN_RAD, REACH_RAD
            if self._back.value < 0.3 * back_m:
                lean = reach = 0.0
            if self._back.value == self._down.value == 0.0:
                self.phase, self._held_s = Phase.UPRIGHT, 0.0
        self._lean.advance(lean)
        self._reach.advance(reach)
        change = _UNLOADING_PER_S * _DT
        self._unloaded += min(max(bears - self._unloaded, -change), change)

    def _needed(self) -> float:
        """How far down it has to be for the legs to reach the ground from ``back_m``."""
        return float(np.interp(self._back.value, self._backs_m, self._needs_m))


def _reachable(robot: RobotModel, standing_m: float) -> tuple[np.ndarray, np.ndarray, float]:
    """How far back the legs allow the base (n,), how far down it has to be there (n,), and how far
    down it can be at the last of these; metres."""
    legs = LegTracker(robot)
    soles = np.zeros((len(robot.legs), 4))
    soles[:, :2] = robot.foot_offsets_m
    soles[:, 2] = [leg.sole_m for leg in robot.legs]

    def reaches(back_m: float, down_m: float) -> bool:
        qpos = robot.rest_qpos.copy()
        qpos[[0, 2]] = -back_m, standing_m - down_m
        legs.solve(qpos, soles)
        return bool(legs.missed_m(qpos, soles).max() < _REACH_M)

    backs, needs, down_m = [0.0], [0.0], 0.0
    for back_m in np.arange(_STEP_M, STAND_OFF_M + _DEPTH_M + 1e-9, _STEP_M):
        while down_m < standing_m and not reaches(back_m, down_m):
            down_m += _STEP_M
        if down_m >= standing_m:
            break
        backs.append(float(back_m))
        needs.append(down_m)
    lowest_m = needs[-1]
    while lowest_m + _STEP_M < standing_m and reaches(backs[-1], lowest_m + _STEP_M):
        lowest_m += _STEP_M
    return np.array(backs), np.array(needs), lowest_m

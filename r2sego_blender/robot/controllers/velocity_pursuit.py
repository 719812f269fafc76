"""Velocity commands that take a simulated base along its way, by where it really is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..planning.free_floor import CELL_M
from .policy_layout import Commands
from .policy_observation import Command

_LOOK_AHEAD = 5  # points of a path, CELL_M apart
_HEADING_GAIN = 2.0  # 1/s
_BRAKE_GAIN = 1.0  # 1/s
_ARRIVED_M, _FACING_RAD = 0.08, math.radians(6.0)
# A stander that has drifted so far walks back.
_STRAYED_M, _STRAYED_RAD = 0.18, math.radians(20.0)
_HEIGHT_RATE_M_S = 0.25


@dataclass(frozen=True)
class Stage:
    """Go along ``path`` (n, 2), then stand at its end for ``hold_s``.

    ``facing_rad``: the heading all the while, None to face the way and keep the last;
    ``height_m`` of the base, for policies that are told one.
    """

    path: np.ndarray
    facing_rad: float | None = None
    height_m: float = 0.0
    hold_s: float = 0.0


class VelocityPursuit:
    """Pursues ``stages`` one after the other and stands at the last one's end.

    Velocities keep ``speed_m_s``, ``turn_rate_rad_s`` and the policy's own limits.
    """

    def __init__(self, stages: Sequence[Stage], limits: Commands, speed_m_s: float, turn_rate_rad_s: float) -> None:
        self._stages, self._limits = list(stages), limits
        self._speed_m_s = speed_m_s
        turn_rate_rad_s = max(turn_rate_rad_s, limits.slowest_turn_rad_s)
        low, high = limits.yaw_rate_rad_s
        self._yaw_rates = max(low, -turn_rate_rad_s), min(high, turn_rate_rad_s)
        self._nearest, self._held_s, self._stands = 0, 0.0, False
        self._kept_rad: float | None = None
        self._height_m = limits.walking_height_m

    def command(self, qpos: np.ndarray, period_s: float) -> Command:
        """The command for the next ``period_s`` of a base at ``qpos`` (7,)."""
        stage = self._stages[0]
        yaw = heading_rad(qpos)
        aim = stage.path[self._aim(stage.path, qpos[:2])]
        offset = aim - qpos[:2]
        left_m = math.dist(qpos[:2], stage.path[-1])
        facing = stage.facing_rad if self._kept_rad is None else self._kept_rad
        if facing is None:
            facing = yaw if left_m < _STRAYED_M else math.atan2(offset[1], offset[0])
        turn = math.remainder(facing - yaw, math.tau)
        low = math.isfinite(self._height_m) and self._change_height(stage.height_m, period_s)
        arrived = left_m < _ARRIVED_M and abs(turn) < _FACING_RAD
        strayed = left_m > _STRAYED_M or abs(turn) > _STRAYED_RAD
        self._stands = arrived or (self._stands and not strayed)
        if self._stands:
            self._kept_rad = facing  # who strays from the goal does not turn to walk back
            self._held_s += 0.0 if low else period_s
            if self._held_s >= stage.hold_s and len(self._stages) > 1:
                self._stages.pop(0)
                self._nearest, self._held_s, self._stands, self._kept_rad = 0, 0.0, False, None
            return Command(base_height_m=self._height_m)
        # Turning comes before walking: the eyes lead the way.
        wanted = min(self._speed_m_s, _BRAKE_GAIN * left_m) * 0.5 * (1.0 + math.cos(turn))
        speed = max(wanted, self._limits.slowest_m_s) if left_m > _ARRIVED_M else 0.0
        vx, vy = self._within_limits(offset, yaw, speed)
        yaw_rate = _HEADING_GAIN * turn
        if speed == 0.0 and abs(yaw_rate) < self._limits.slowest_turn_rad_s:
            yaw_rate = math.copysign(self._limits.slowest_turn_rad_s, turn)
        yaw_rate = min(max(yaw_rate, self._yaw_rates[0]), self._yaw_rates[1])
        return Command(vx, vy, yaw_rate, True, self._height_m)

    def _aim(self, path: np.ndarray, place: np.ndarray) -> int:
        """The path's point to make for, ahead of the nearest one."""
        window = path[self._nearest : self._nearest + 2 * _LOOK_AHEAD]
        self._nearest += int(np.argmin(((window - place) ** 2).sum(axis=1)))
        return min(self._nearest + _LOOK_AHEAD, len(path) - 1)

    def _within_limits(self, offset: np.ndarray, yaw: float, speed: float) -> tuple[float, float]:
        """Velocity ahead and to the left, towards ``offset``, no faster than the policy walks."""
        angle = math.atan2(offset[1], offset[0]) - yaw
        velocity = speed * math.cos(angle), speed * math.sin(angle)
        share = 1.0
        for value, (low, high) in zip(velocity, (self._limits.vx_m_s, self._limits.vy_m_s), strict=True):
            bound = high if value > 0.0 else -low
            share = min(share, bound / abs(value)) if abs(value) > 1e-6 else share
        return share * velocity[0], share * velocity[1]

    def _change_height(self, wanted_m: float, period_s: float) -> bool:
        """Whether the commanded height is still on its way to ``wanted_m``."""
        step = _HEIGHT_RATE_M_S * period_s
        self._height_m += min(max(wanted_m - self._height_m, -step), step)
        return abs(wanted_m - self._height_m) > 1e-9


def straight(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """A path (n, 2) between two points, ``CELL_M`` between its own."""
    count = max(2, math.ceil(math.dist(start, end) / CELL_M) + 1)
    return start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)


def heading_rad(qpos: np.ndarray) -> float:
    """Where a base at ``qpos`` (7,) faces."""
    w, x, y, z = qpos[3:7]
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))

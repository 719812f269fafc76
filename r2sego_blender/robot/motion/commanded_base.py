"""The base's reference on the floor: commanded velocities, integrated with bounded accelerations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ..behaviours.trajectory import RATE_HZ

# A reference farther off comes back at this share of what is too much in a second.
_RETURN_PER_S, _RETURN_M_S, _RETURN_RAD_S = 4.0, 0.4, 0.8
_DT = 1.0 / RATE_HZ


@dataclass(frozen=True)
class Leash:
    """How far the reference goes from the real base: what holds the robot back holds the reference, too.

    From the nearer distance on it goes no farther so fast, from the farther one on not at all.
    """

    m: tuple[float, float] = (0.05, 0.12)
    rad: tuple[float, float] = (0.15, 0.35)


class CommandedBase:
    """Where the reference stands, frame by frame at ``RATE_HZ``.

    ``x``, ``y`` metres, ``yaw`` radians, not wrapped; ``velocity`` ahead, to the left (m/s)
    and of the heading (rad/s).
    """

    def __init__(self, accelerations: Sequence[float], leash: Leash = Leash()) -> None:
        self._accelerations, self._leash = tuple(accelerations), leash
        self.x = self.y = self.yaw = 0.0
        self.velocity = [0.0, 0.0, 0.0]

    def start(self, x: float, y: float, yaw: float) -> None:
        """Stand there."""
        self.x, self.y, self.yaw = x, y, yaw
        self.velocity = [0.0, 0.0, 0.0]

    def advance(self, wanted: Sequence[float], real: tuple[float, float, float]) -> None:
        """One frame towards the ``wanted`` velocity (3,), with the robot's base at ``real`` (x, y, yaw)."""
        for axis, (value, bound) in enumerate(zip(wanted, self._accelerations, strict=True)):
            change = value - self.velocity[axis]
            self.velocity[axis] += min(max(change, -bound * _DT), bound * _DT)
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        forward, aside, rate = self.velocity
        vx, vy = cos * forward - sin * aside, sin * forward + cos * aside
        ahead_x, ahead_y = self.x - real[0], self.y - real[1]
        ahead_m = math.hypot(ahead_x, ahead_y)
        if ahead_m > self._leash.m[0]:
            ahead_x, ahead_y = ahead_x / ahead_m, ahead_y / ahead_m
            away = max(0.0, vx * ahead_x + vy * ahead_y)
            held = away * min(1.0, (ahead_m - self._leash.m[0]) / (self._leash.m[1] - self._leash.m[0]))
            vx, vy = vx - held * ahead_x, vy - held * ahead_y
            self.velocity[0], self.velocity[1] = cos * vx + sin * vy, cos * vy - sin * vx
            back = min(_RETURN_PER_S * max(0.0, ahead_m - self._leash.m[1]), _RETURN_M_S)
            vx, vy = vx - back * ahead_x, vy - back * ahead_y
        turned = math.remainder(self.yaw - real[2], math.tau)
        if abs(turned) > self._leash.rad[0]:
            if rate * turned > 0.0:
                rate *= max(0.0, 1.0 - (abs(turned) - self._leash.rad[0]) / (self._leash.rad[1] - self._leash.rad[0]))
                self.velocity[2] = rate
            back = min(_RETURN_PER_S * max(0.0, abs(turned) - self._leash.rad[1]), _RETURN_RAD_S)
            rate -= math.copysign(back, turned)
        self.x, self.y, self.yaw = self.x + vx * _DT, self.y + vy * _DT, self.yaw + rate * _DT

    def ahead(self, wanted: Sequence[float], seconds: float) -> tuple[float, float, float]:
        """(x, y, yaw) in so many seconds, where the ``wanted`` velocity (3,) stays."""
        forward, aside, turned = (
            _way(now, value, bound, seconds)
            for now, value, bound in zip(self.velocity, wanted, self._accelerations, strict=True)
        )
        # Along the chord of the arc.
        half = 0.5 * turned
        chord = math.sin(half) / half if abs(half) > 1e-6 else 1.0
        cos, sin = chord * math.cos(self.yaw + half), chord * math.sin(self.yaw + half)
        return self.x + cos * forward - sin * aside, self.y + sin * forward + cos * aside, self.yaw + turned

    @property
    def is_still(self) -> bool:
        """Whether it does not move."""
        return self.velocity == [0.0, 0.0, 0.0]


def _way(now: float, wanted: float, acceleration: float, seconds: float) -> float:
    """How far who goes at ``now`` and changes to ``wanted`` comes in ``seconds``."""
    changing_s = min(seconds, abs(wanted - now) / acceleration)
    reached = now + math.copysign(acceleration * changing_s, wanted - now)
    return 0.5 * (now + reached) * changing_s + wanted * (seconds - changing_s)

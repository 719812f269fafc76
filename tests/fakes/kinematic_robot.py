"""A robot without physics: it moves as told with bounded accelerations, and is carried by a seat behind it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from r2sego_blender.policy.environment.state import PrivilegedState
from r2sego_blender.robot.behaviours.trajectory import Seat
from r2sego_blender.robot.controllers.commanded_drive import DriveCommand
from r2sego_blender.robot.planning.free_floor import CELL_M, FreeFloor

STANDING_M = 0.75
_LOWEST_M, _LOWERING_M_S = 0.35, 0.2
_ACCELERATIONS = np.array([1.0, 0.8, 3.0])


@dataclass
class KinematicRobot:
    """The true state of a robot on ``floor`` that is to sit on ``seat``, or to walk to ``goal``."""

    floor: FreeFloor
    seat: Seat | None
    place: np.ndarray
    yaw_rad: float
    goal: np.ndarray | None = None
    carrying_m: float = 0.2  # a base no farther before the edge, as it sinks, is carried
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    height_m: float = STANDING_M
    seated_s: float = 0.0
    time_s: float = 0.0

    @property
    def state(self) -> PrivilegedState:
        return PrivilegedState(
            self.place.copy(),
            self.yaw_rad,
            self.height_m + self.floor.floor_z_m,
            self.seat,
            self.goal,
            self.seated_s > 0.0,
            self.seated_s,
            self.time_s,
            0.0,
            "",
        )

    @property
    def has_hit(self) -> bool:
        """Whether it stands neither beside a free cell nor on the last steps to the seat."""
        around = CELL_M * np.array([(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1)])
        if self.floor.is_free(self.place + around).any():
            return False
        if self.seat is None:
            return True
        offset = self.place - self.seat.edge_m
        ahead = np.array([math.cos(self.seat.yaw_rad), math.sin(self.seat.yaw_rad)])
        along, lateral = float(offset @ ahead), float(ahead[0] * offset[1] - ahead[1] * offset[0])
        return not (-0.05 < along < self.seat.approach_m + 0.1 and abs(lateral) < 0.25)

    def step(self, command: DriveCommand, seconds: float = 0.1) -> None:
        """Do as commanded for a while."""
        for _ in range(2):
            self._tick(command, seconds / 2)
        self.time_s += seconds

    def _tick(self, command: DriveCommand, dt: float) -> None:
        low = self.height_m < STANDING_M - 1e-9
        wanted = np.array([command.vx_m_s, command.vy_m_s, command.yaw_rate_rad_s]) * (not low and not command.sit)
        self.velocity += np.clip(wanted - self.velocity, -_ACCELERATIONS * dt, _ACCELERATIONS * dt)
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        vx, vy, turn = self.velocity
        self.place = self.place + dt * np.array([cos * vx - sin * vy, sin * vx + cos * vy])
        self.yaw_rad += dt * turn
        if not command.sit:
            self.height_m, self.seated_s = min(STANDING_M, self.height_m + _LOWERING_M_S * dt), 0.0
        elif np.linalg.norm(self.velocity) < 0.05:
            self._lower(dt)

    def _lower(self, dt: float) -> None:
        floor_m = _LOWEST_M
        if self.seat is not None and self._is_over_seat():
            floor_m = self.seat.height_m - self.floor.floor_z_m + 0.1
        self.height_m = max(floor_m, self.height_m - _LOWERING_M_S * dt)
        self.seated_s = self.seated_s + dt if self.height_m == floor_m > _LOWEST_M else 0.0

    def _is_over_seat(self) -> bool:
        assert self.seat is not None
        offset = self.place - self.seat.edge_m
        ahead = np.array([math.cos(self.seat.yaw_rad), math.sin(self.seat.yaw_rad)])
        lateral = ahead[0] * offset[1] - ahead[1] * offset[0]
        turned = abs(math.remainder(self.seat.yaw_rad - self.yaw_rad, math.tau))
        return bool(-0.3 < offset @ ahead < self.carrying_m and abs(lateral) < 0.12 and turned < 0.3)

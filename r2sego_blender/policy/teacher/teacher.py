"""The teacher of a scene: commands for any state of an episode in it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...robot.controllers.commanded_drive import DriveCommand, DriveLimits
from ...robot.planning.free_floor import FreeFloor
from ..environment.state import PrivilegedState
from .cost_to_go import CostToGo
from .phase import Name, Phase, SeatFrame, begun, following, stand_off_m

_LOOK_AHEAD_M = 0.5
_DECELERATION_M_S2 = 0.4
# Beyond this heading error the robot turns on the spot: in the open, and at the edge of the free floor.
_WALK_WITHIN_RAD, _WALK_AT_EDGE_WITHIN_RAD = math.radians(50.0), math.radians(15.0)
_OPEN_M = 0.2
_TURN_GAIN, _PLACE_GAIN = 2.0, 1.5  # 1/s
_CRUISE_M_S, _SLOWEST_M_S, _BACK_M_S = 0.5, 0.08, 0.2
# Obstacles so near slow it down: 1/s.
_CLEARANCE_GAIN = 2.0
_STOP_M = 0.1
_BEYOND_M = 0.1


@dataclass(frozen=True)
class _Velocity:
    """A velocity in the base's frame."""

    ahead: float
    left: float
    turn: float


class Teacher:
    """Walks around obstacles to the seat, turns its back to it, backs up, sits, and tries again where it missed.

    ``floor`` is where the robot may stand, ``standing_m`` the resting base's height above that floor. What
    ``label`` gives depends on its arguments alone.
    """

    def __init__(self, floor: FreeFloor, standing_m: float, limits: DriveLimits | None = None) -> None:
        self.floor, self._limits = floor, limits or DriveLimits()
        self._standing_m = standing_m + floor.floor_z_m
        self._ways: dict[tuple[float, float], CostToGo] = {}

    def label(self, state: PrivilegedState, phase: Phase | None = None) -> tuple[DriveCommand, Phase]:
        """What to do in ``state``, and the phase to give with the state that follows; None for the first."""
        seat = state.seat
        if seat is None:
            return self._walk(state)
        if phase is None:
            now = begun(state, seat, self._standing_m)
        else:
            now = following(phase, state, seat, self._standing_m)
        frame = SeatFrame.of(seat, state.base_xy_m, state.yaw_rad)
        turning_place = seat.ahead(seat.approach_m)
        beyond = seat.ahead(seat.approach_m + _BEYOND_M)  # where it does not slow down before it is on free floor
        match now.name:
            case Name.SIT | Name.HOLD:
                return DriveCommand(0.0, 0.0, 0.0, True), now
            case Name.STAND_UP:
                return DriveCommand(0.0, 0.0, 0.0, False), now
            case Name.STEP_AHEAD:
                return self._within(self._towards(beyond, state, _BACK_M_S)), now
            case Name.BACK_UP:
                wanted = seat.ahead(stand_off_m(now) - 0.5 * _BEYOND_M)  # it does not slow down before it is there
                moved = self._towards(wanted, state, _BACK_M_S)
                return self._within(_Velocity(moved.ahead, moved.left, _TURN_GAIN * frame.error_rad)), now
            case Name.TURN:
                free = bool(self.floor.is_free(state.base_xy_m))
                aim = self._way_to(turning_place, state.base_xy_m)[0] if free else beyond
                moved = self._towards(aim, state, _BACK_M_S)
                turn = frame.error_rad
                if now.side and turn * now.side < 0.0:
                    turn += math.copysign(math.tau, now.side)
                # Beside furniture it steps away before it turns.
                return self._within(_Velocity(moved.ahead, moved.left, _TURN_GAIN * turn if free else 0.0)), now
        return self._within(self._along_way(turning_place, state)), now

    def _walk(self, state: PrivilegedState) -> tuple[DriveCommand, Phase]:
        goal = state.goal_xy_m
        if goal is None or np.linalg.norm(goal - state.base_xy_m) < _STOP_M:
            return DriveCommand(0.0, 0.0, 0.0, False), Phase(Name.HOLD)
        return self._within(self._along_way(goal, state)), Phase(Name.APPROACH)

    def _along_way(self, goal: np.ndarray, state: PrivilegedState) -> _Velocity:
        """Along the way to ``goal`` (2,), looking ahead; from where it may not stand without a turn."""
        place = state.base_xy_m
        aim, left_m = self._way_to(goal, place)
        if not self.floor.is_free(place):
            return self._towards(aim, state, _BACK_M_S)
        error = math.remainder(math.atan2(aim[1] - place[1], aim[0] - place[0]) - state.yaw_rad, math.tau)
        clearance_m = float(self.floor.clearance_m[self.floor.cells(place)])
        speed = min(_CRUISE_M_S, _BACK_M_S + _CLEARANCE_GAIN * clearance_m)
        speed = max(_SLOWEST_M_S, min(speed, math.sqrt(2.0 * _DECELERATION_M_S2 * left_m) * 0.8))
        within = np.interp(clearance_m, (0.05, _OPEN_M), (_WALK_AT_EDGE_WITHIN_RAD, _WALK_WITHIN_RAD))
        return _Velocity(speed * max(0.0, 1.0 - abs(error) / float(within)), 0.0, _TURN_GAIN * error)

    def _way_to(self, goal: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, float]:
        """Where the way from ``place`` to ``goal``, (2,) both, leads straight ahead, and how long it is."""
        key = (float(goal[0]), float(goal[1]))
        if key not in self._ways:
            self._ways[key] = CostToGo(self.floor, goal)
        return self._ways[key].aim(place, _LOOK_AHEAD_M)

    def _towards(self, place: np.ndarray, state: PrivilegedState, speed_m_s: float) -> _Velocity:
        """Straight to ``place`` (2,), in any direction, without turning."""
        offset = place - state.base_xy_m
        distance_m = float(np.hypot(*offset))
        speed = min(speed_m_s, _PLACE_GAIN * distance_m)
        angle = math.atan2(offset[1], offset[0]) - state.yaw_rad
        return _Velocity(speed * math.cos(angle), speed * math.sin(angle), 0.0)

    def _within(self, wanted: _Velocity) -> DriveCommand:
        """The command, slowed down to the drive's limits in its direction."""
        share = 1.0
        for value, (low, high) in ((wanted.ahead, self._limits.vx_m_s), (wanted.left, self._limits.vy_m_s)):
            bound = high if value > 0.0 else -low
            share = min(share, bound / abs(value)) if abs(value) > 1e-9 else share
        low, high = self._limits.yaw_rate_rad_s
        return DriveCommand(share * wanted.ahead, share * wanted.left, min(max(wanted.turn, low), high), False)

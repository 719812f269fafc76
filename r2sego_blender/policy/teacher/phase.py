"""The phases of walking to a seat and sitting down, and when one follows another."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from ...robot.behaviours.trajectory import STAND_OFF_M, Seat
from ..environment.state import PrivilegedState


class Name(StrEnum):
    """What the teacher is about."""

    APPROACH = "approach"
    TURN = "turn"
    BACK_UP = "back_up"
    SIT = "sit"
    HOLD = "hold"
    STAND_UP = "stand_up"
    STEP_AHEAD = "step_ahead"


@dataclass(frozen=True)
class Phase:
    """Where the teacher is: all it remembers from one state to the next.

    ``since_s`` is the episode's time from which patience counts; ``side`` the way it turns, 1 to the left, 0
    where it is free to choose; ``tries`` how often it lowered and found no seat.
    """

    name: Name
    since_s: float = 0.0
    side: int = 0
    tries: int = 0


# The base is upright above this share of its standing height.
_UPRIGHT = 0.88
_ARRIVED_M, _NEAR_M, _LEFT_M = 0.12, 0.3, 0.9
# Who is so near to the place before the seat, and so far turned away from it, steps there without turning round.
_STEP_THERE_M, _STEP_THERE_RAD = 0.6, 1.2
_TURNED_RAD, _LATERAL_M = 0.12, 0.08
# Backing up is given up beyond these, and begun from within their halves.
_ASTRAY_RAD, _ASTRAY_M = 0.35, 0.16
_BEFORE_SEAT_M, _LEFT_SEAT_M = 0.05, 0.1
_SIT_WITHIN_RAD, _SIT_WITHIN_M = 0.12, 0.06
_DEEPER_A_TRY_M, _MOST_DEEPER_M = 0.05, 0.1
_PATIENCE_S, _LOST_SEAT_S = 4.0, 1.5
# Who backs up for longer leans against something.
_BACKING_S = 6.0
# About to face away from the seat, a robot that has it straight ahead turns to the left; it may change its mind, and go
# back and forth, where one way has become clearly the shorter one.
_EITHER_SIDE_RAD, _SHORTER_RAD = 2.6, 2.0


@dataclass(frozen=True)
class SeatFrame:
    """A base as the seat sees it: ``along_m`` before the edge, ``lateral_m`` to its left, ``error_rad`` to turn."""

    along_m: float
    lateral_m: float
    error_rad: float

    @staticmethod
    def of(seat: Seat, place: np.ndarray, yaw_rad: float) -> SeatFrame:
        """The base at ``place`` (2,), heading along ``yaw_rad``."""
        offset = np.asarray(place) - seat.edge_m
        cos, sin = math.cos(seat.yaw_rad), math.sin(seat.yaw_rad)
        return SeatFrame(
            float(offset[0] * cos + offset[1] * sin),
            float(offset[1] * cos - offset[0] * sin),
            math.remainder(seat.yaw_rad - yaw_rad, math.tau),
        )

    def is_aligned(self, rad: float, lateral_m: float) -> bool:
        """Whether it has its back to the seat, to within these."""
        return abs(self.error_rad) < rad and abs(self.lateral_m) < lateral_m


def stand_off_m(phase: Phase) -> float:
    """How far before the edge to sit down: nearer after each try that missed."""
    return STAND_OFF_M - min(_DEEPER_A_TRY_M * phase.tries, _MOST_DEEPER_M)


def side_of(error_rad: float) -> int:
    """The way to turn: the shorter one, to the left where both are as long."""
    return 1 if error_rad > 0.0 or error_rad < -_EITHER_SIDE_RAD else -1


def begun(state: PrivilegedState, seat: Seat, standing_m: float) -> Phase:
    """The phase of a state of which nothing earlier is known; ``standing_m`` is the base's height above z = 0."""
    frame = SeatFrame.of(seat, state.base_xy_m, state.yaw_rad)
    now = state.time_s
    if state.is_seated:
        return Phase(Name.HOLD, now)
    over_seat = frame.along_m < STAND_OFF_M + _SIT_WITHIN_M and frame.is_aligned(_ASTRAY_RAD, _ASTRAY_M)
    if state.base_height_m < _UPRIGHT * standing_m:
        return Phase(Name.SIT if over_seat and frame.along_m > -0.3 else Name.STAND_UP, now)
    near = -0.1 < frame.along_m < seat.approach_m + _ARRIVED_M
    if near and frame.is_aligned(0.5 * _ASTRAY_RAD, 0.5 * _ASTRAY_M):
        return Phase(Name.BACK_UP, now)
    if near and frame.along_m < seat.approach_m - _ARRIVED_M and abs(frame.lateral_m) < seat.approach_m:
        return Phase(Name.STEP_AHEAD, now)
    away_m = float(np.linalg.norm(state.base_xy_m - seat.ahead(seat.approach_m)))
    if _may_step_there(away_m, frame):
        return Phase(Name.TURN, now, side_of(frame.error_rad))
    return Phase(Name.APPROACH, now)


def _may_step_there(away_m: float, frame: SeatFrame) -> bool:
    """Whether it gets to the place before the seat, ``away_m`` from it, by steps, without facing it."""
    return away_m < _NEAR_M or (away_m < _STEP_THERE_M and abs(frame.error_rad) < _STEP_THERE_RAD)


def following(phase: Phase, state: PrivilegedState, seat: Seat, standing_m: float) -> Phase:
    """The phase of ``state``, when ``phase`` was that of the state before it."""
    frame = SeatFrame.of(seat, state.base_xy_m, state.yaw_rad)
    now = state.time_s
    if state.is_seated:
        return replace(phase, name=Name.HOLD, since_s=now)
    if state.base_height_m < _UPRIGHT * standing_m:
        return _lowered(phase, frame, now)
    away_m = float(np.linalg.norm(state.base_xy_m - seat.ahead(seat.approach_m)))
    turning = replace(phase, name=Name.TURN, side=side_of(frame.error_rad), since_s=now)
    before = frame.along_m < stand_off_m(phase) + _BEFORE_SEAT_M
    match phase.name:
        case Name.APPROACH if _may_step_there(away_m, frame):
            return turning
        case Name.TURN if frame.is_aligned(_TURNED_RAD, _LATERAL_M):
            return replace(phase, name=Name.BACK_UP, side=0, since_s=now)
        case Name.TURN if away_m > _LEFT_M:
            return replace(begun(state, seat, standing_m), tries=phase.tries)
        case Name.TURN if abs(frame.error_rad) < _SHORTER_RAD:
            return replace(phase, side=0)
        case Name.STAND_UP:
            return replace(phase, name=Name.STEP_AHEAD, since_s=now)
        case Name.STEP_AHEAD if away_m < _ARRIVED_M or frame.along_m > seat.approach_m:
            return turning
        case Name.STEP_AHEAD if frame.along_m < -0.1 or abs(frame.lateral_m) > _STEP_THERE_M:
            return replace(phase, name=Name.APPROACH, since_s=now)
        case Name.BACK_UP if before and frame.is_aligned(_SIT_WITHIN_RAD, _SIT_WITHIN_M):
            return replace(phase, name=Name.SIT, since_s=now)
        case Name.BACK_UP | Name.SIT | Name.HOLD if not frame.is_aligned(_ASTRAY_RAD, _ASTRAY_M):
            return replace(begun(state, seat, standing_m), tries=phase.tries)
        case Name.BACK_UP if before and frame.along_m < 0.02:  # at the edge, and not aligned
            return replace(phase, name=Name.STEP_AHEAD, since_s=now)
        case Name.BACK_UP if now - phase.since_s > _BACKING_S:
            return replace(phase, name=Name.STEP_AHEAD, since_s=now)
        case Name.SIT | Name.HOLD if frame.along_m > stand_off_m(phase) + _LEFT_SEAT_M:
            return replace(phase, name=Name.BACK_UP, since_s=now)
        case Name.BACK_UP if frame.along_m > seat.approach_m + _LEFT_M:
            return replace(begun(state, seat, standing_m), tries=phase.tries)
        case Name.SIT | Name.HOLD:  # patience counts from when it is no longer upright
            return replace(phase, name=Name.SIT, since_s=now)
    return phase


def _lowered(phase: Phase, frame: SeatFrame, now: float) -> Phase:
    """The phase of a base that is down and not carried by the seat."""
    match phase.name:
        case Name.STAND_UP:
            return phase
        case Name.HOLD:
            lost = now - phase.since_s > _LOST_SEAT_S
            return replace(phase, name=Name.SIT, since_s=now) if lost else phase
        case Name.SIT:
            missed = now - phase.since_s > _PATIENCE_S
            return Phase(Name.STAND_UP, now, tries=phase.tries + 1) if missed else phase
    # It sat down of its own accord: let it, where there is a seat behind it.
    over_seat = frame.along_m < stand_off_m(phase) + _SIT_WITHIN_M and frame.is_aligned(_ASTRAY_RAD, _ASTRAY_M)
    return replace(phase, name=Name.SIT if over_seat else Name.STAND_UP, since_s=now)

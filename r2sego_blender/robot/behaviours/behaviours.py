"""The declared behaviours, each drawn from the scope as a trajectory of the robot's root."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..scope.scope import BehaviourScope, Range
from .free_floor import FreeFloor
from .navigation import RATE_HZ, draw_cell, draw_path, line_is_free, path_between, pursue
from .seats import STAND_OFF_M, Seat

# Mean speed of small steps, which start and end at rest, and of lowering the body.
_STEP_SPEED_M_S = 0.22
_CROUCH_S = 1.4
# Standing before a squat, before sitting down, and what is seated longer than asked for.
_STILL_S, _SEATED_MARGIN_S = 0.4, 0.6
# How far the arms are lifted forward, for balance.
_REACH_RAD = 0.8
_TRIES = 40


@dataclass(frozen=True)
class RootTrajectory:
    """The base's reference on the floor at ``RATE_HZ``, and what the body does besides.

    ``xy`` (T, 2) metres, ``yaw`` (T,) radians, not wrapped, ``speed`` (T,) m/s: where the
    robot stands and walks. ``crouch`` (T,) is the lowering, as a share of the standing
    height; ``lean`` and ``reach`` (T,) radians of the waist and of the arms, forward; ``sit``
    (T,) from 0, standing, to 1, on the ``seat``, ``depth_m`` behind its front edge. ``goal``
    (2,) is where the base has to end.
    """

    behaviour: str
    xy: np.ndarray
    yaw: np.ndarray
    speed: np.ndarray
    goal: np.ndarray
    crouch: np.ndarray
    lean: np.ndarray
    reach: np.ndarray
    sit: np.ndarray
    seat: Seat | None = None
    depth_m: float = 0.0


def draw(limits: Range, rng: np.random.Generator) -> float:
    """A uniform draw from a scope's range."""
    return float(rng.uniform(*limits))


def eased(phase: np.ndarray) -> np.ndarray:
    """0 to 1 over ``phase`` 0 to 1, at rest at both ends; its greatest slope is 1.875."""
    phase = np.clip(phase, 0.0, 1.0)
    return phase**3 * (10.0 - 15.0 * phase + 6.0 * phase**2)


def plan_root(
    floor: FreeFloor, scope: BehaviourScope, rng: np.random.Generator, seats: Sequence[Seat] = ()
) -> RootTrajectory | None:
    """Draw a behaviour and its trajectory.

    None when no reachable place lies in the scope's ranges.
    """
    names = [field.name for field in dataclasses.fields(scope.behaviours)]
    weights = np.cumsum(dataclasses.astuple(scope.behaviours))
    behaviour = names[int(np.searchsorted(weights, rng.random() * weights[-1], side="right"))]
    if behaviour == "sit_on":
        return _sit_on(floor, scope, seats, rng)
    return {
        "walk_to": _walk_to, "look_around": _look_around, "step_around": _step_around, "squat": _squat,
    }[behaviour](floor, scope, rng)  # fmt: skip


def _walk_to(floor: FreeFloor, scope: BehaviourScope, rng: np.random.Generator) -> RootTrajectory | None:
    start = draw_cell(floor.free, rng)
    speed_m_s, turn_rate = _pace(scope, rng)
    turn = math.radians(draw(scope.look_around.turn_deg, rng))
    path = draw_path(floor, start, scope, speed_m_s, rng)
    if path is None:
        return None
    heading = _first_heading(path, scope, rng)
    way = pursue(path, heading, lambda at: at + turn, speed_m_s, turn_rate, scope.episode.duration_s)
    return _upright("walk_to", way.xy, way.yaw, way.speed, path[-1])


def _look_around(floor: FreeFloor, scope: BehaviourScope, rng: np.random.Generator) -> RootTrajectory:
    place, heading = _stand(floor, rng)
    _, turn_rate = _pace(scope, rng)
    turn = math.radians(draw(scope.look_around.turn_deg, rng))
    way = pursue(place[None], heading, lambda at: at + turn, 0.0, turn_rate, scope.episode.duration_s)
    return _upright("look_around", way.xy, way.yaw, way.speed, place)


def _step_around(floor: FreeFloor, scope: BehaviourScope, rng: np.random.Generator) -> RootTrajectory:
    """Displacements in any direction, with the heading kept; those off the free floor are left out."""
    place, heading = _stand(floor, rng)
    times = _times(scope.episode.duration_s)
    xy, at_s = np.tile(place, (len(times), 1)), 0.0
    while True:
        at_s += draw(scope.step_around.pause_s, rng)
        length_m, direction = draw(scope.step_around.step_m, rng), rng.uniform(-math.pi, math.pi)
        target = place + length_m * np.array([math.cos(direction), math.sin(direction)])
        seconds = length_m / _STEP_SPEED_M_S
        if at_s + seconds > times[-1]:
            break
        if line_is_free(floor, place, target):
            xy += eased((times - at_s) / seconds)[:, None] * (target - place)
            place, at_s = target, at_s + seconds
    speed = np.linalg.norm(np.gradient(xy, 1.0 / RATE_HZ, axis=0), axis=1)
    return _upright("step_around", xy, np.full(len(times), heading), speed, place)


def _squat(floor: FreeFloor, scope: BehaviourScope, rng: np.random.Generator) -> RootTrajectory:
    place, heading = _stand(floor, rng)
    times = _times(scope.episode.duration_s)
    crouch, lean, at_s = np.zeros(len(times)), np.zeros(len(times)), _STILL_S
    while True:
        depth = 1.0 - draw(scope.squat.height, rng)
        lean_rad = math.radians(draw(scope.squat.lean_deg, rng))
        rise_s = at_s + _CROUCH_S + draw(scope.squat.hold_s, rng)
        if rise_s + _CROUCH_S > times[-1]:
            break
        low = eased((times - at_s) / _CROUCH_S) - eased((times - rise_s) / _CROUCH_S)
        crouch, lean, at_s = crouch + depth * low, lean + lean_rad * low, rise_s + _CROUCH_S + _STILL_S
    still = np.zeros(len(times))
    return RootTrajectory(
        "squat", np.tile(place, (len(times), 1)), np.full(len(times), heading), still, place,
        crouch, lean, _REACH_RAD * lean / max(lean.max(), 1e-9), still,
    )  # fmt: skip


def _sit_on(
    floor: FreeFloor, scope: BehaviourScope, seats: Sequence[Seat], rng: np.random.Generator
) -> RootTrajectory | None:
    """Walk before a seat, turn, step back to it, sit down and stay.

    Surfaces are drawn alike, however many places they have. The episode's length is the most
    that all of it may take.
    """
    surfaces = sorted({seat.surface for seat in seats})
    for _ in range(_TRIES if surfaces else 0):
        surface = surfaces[int(rng.integers(len(surfaces)))]
        places = [seat for seat in seats if seat.surface == surface]
        seat = places[int(rng.integers(len(places)))]
        found = _approach(floor, scope, seat, rng)
        if found is not None:
            return found
    return None


def _approach(
    floor: FreeFloor, scope: BehaviourScope, seat: Seat, rng: np.random.Generator
) -> RootTrajectory | None:
    speed_m_s, turn_rate = _pace(scope, rng)
    depth_m = draw(scope.sit_on.depth_m, rng)
    down_s = draw(scope.sit_on.down_s, rng)
    lean_rad = math.radians(draw(scope.sit_on.lean_deg, rng))
    start = draw_cell(floor.free, rng)
    turning = seat.ahead(seat.approach_m)
    row, column = floor.cells(turning)
    path = path_between(floor, start, (int(row), int(column)))
    if path is None:
        return None
    path[-1] = turning
    heading = _first_heading(path, scope, rng) if len(path) > 1 else rng.uniform(-math.pi, math.pi)
    way = pursue(
        path, heading, lambda at: at + math.remainder(seat.yaw_rad - at, math.tau), speed_m_s, turn_rate,
        scope.episode.duration_s,
    )  # fmt: skip
    stand, seated = seat.ahead(STAND_OFF_M), seat.ahead(-depth_m)
    if way.arrived is None:
        return None
    here = way.xy[way.arrived]
    back_s = max(0.3, math.dist(here, stand) / _STEP_SPEED_M_S)
    walked_s = way.arrived / RATE_HZ
    down_at_s = walked_s + back_s + 2.0 * _STILL_S
    total_s = down_at_s + down_s + scope.sit_on.hold_s + _SEATED_MARGIN_S
    if total_s > scope.episode.duration_s:
        return None
    times = _times(total_s)
    frame = np.minimum(np.arange(len(times)), way.arrived)
    back = eased((times - walked_s) / back_s)
    sit = eased((times - down_at_s) / down_s)
    # Arms forward, lean into the movement, and come upright again once seated.
    reach = eased((times - down_at_s + 0.6) / (0.6 * down_s))
    lean = lean_rad * (eased((times - down_at_s + 0.4) / (0.6 * down_s)) - eased(
        (times - down_at_s - 0.7 * down_s) / (0.8 * down_s)
    ))  # fmt: skip
    return RootTrajectory(
        "sit_on", way.xy[frame] + back[:, None] * (stand - here), way.yaw[frame], way.speed[frame],
        seated, np.zeros(len(times)), lean, _REACH_RAD * reach, sit, seat, depth_m,
    )  # fmt: skip


def _upright(
    behaviour: str, xy: np.ndarray, yaw: np.ndarray, speed: np.ndarray, goal: np.ndarray
) -> RootTrajectory:
    nothing = np.zeros(len(yaw))
    return RootTrajectory(behaviour, xy, yaw, speed, goal, nothing, nothing, nothing, nothing)


def _pace(scope: BehaviourScope, rng: np.random.Generator) -> tuple[float, float]:
    """Walking speed (m/s) and turning rate (rad/s)."""
    return draw(scope.walk_to.speed_m_s, rng), math.radians(draw(scope.walk_to.turn_rate_deg_s, rng))


def _first_heading(path: np.ndarray, scope: BehaviourScope, rng: np.random.Generator) -> float:
    ahead = path[min(len(path) - 1, 4)] - path[0]
    return math.atan2(ahead[1], ahead[0]) + math.radians(draw(scope.start.heading_offset_deg, rng))


def _stand(floor: FreeFloor, rng: np.random.Generator) -> tuple[np.ndarray, float]:
    """A place (2,) and a heading on the free floor."""
    row, column = draw_cell(floor.free, rng)
    return floor.points(np.array(row), np.array(column)), rng.uniform(-math.pi, math.pi)


def _times(duration_s: float) -> np.ndarray:
    return np.arange(round(duration_s * RATE_HZ) + 1) / RATE_HZ

"""Walk to a seat, turn, sit down and look around."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...config.declared_files import is_place
from ...config.fields import Range, setting
from .behaviour import Behaviour, Course
from .trajectory import RATE_HZ, REACH_RAD, STAND_OFF_M, STEP_SPEED_M_S, STILL_S, RootTrajectory, Seat, eased, times

ANY_SEAT = "any"

# What is seated longer than asked for.
_SEATED_MARGIN_S = 0.6
_TRIES = 40


def _target(value: Any, file: Path) -> str | tuple[float, float]:
    if isinstance(value, str) and value:
        return value
    if is_place(value):
        return float(value[0]), float(value[1])
    raise ValueError(f"Write '{ANY_SEAT}', an object's name, or [x, y].")


@dataclass(frozen=True)
class SitOn:
    """Where and how to sit."""

    target: str | tuple[float, float] = setting(
        ANY_SEAT, "Any seat, an object's name, or (x, y) in metres: the seat nearest to it.", read=_target
    )
    height_m: Range = setting((0.28, 0.6), "Heights of the surfaces that are seats.", 0.1, 1.2)
    depth_m: Range = setting((0.08, 0.16), "From the seat's front edge to the pelvis.", 0.0, 0.6)
    lean_deg: Range = setting((20.0, 28.0), "Lean of the waist while sitting down.", 0.0, 60.0)
    down_s: Range = setting((1.6, 2.4), "How long sitting down takes.", 0.5, 10.0)
    hold_s: float = setting(3.0, "Seated this long at the end, or the target is missed.", 0.0, 600.0)


def plan(course: Course) -> RootTrajectory | None:
    """Walk before a seat, turn, step back to it, sit down and stay.

    Surfaces are drawn alike, however many places they have. The episode's length is the most
    that all of it may take.
    """
    surfaces = sorted({seat.surface for seat in course.seats})
    for _ in range(_TRIES if surfaces else 0):
        surface = surfaces[int(course.rng.integers(len(surfaces)))]
        places = [seat for seat in course.seats if seat.surface == surface]
        found = _approach(course, places[int(course.rng.integers(len(places)))])
        if found is not None:
            return found
    return None


def _approach(course: Course, seat: Seat) -> RootTrajectory | None:
    ranges, duration_s = course.scope.sit_on, course.scope.episode.duration_s
    pace = course.pace()
    depth_m = course.draw(ranges.depth_m)
    down_s = course.draw(ranges.down_s)
    lean_rad = math.radians(course.draw(ranges.lean_deg))
    turning = seat.ahead(seat.approach_m)
    path = course.path_to(turning, course.cell())
    if path is None:
        return None
    path[-1] = turning
    heading = course.heading(path) if len(path) > 1 else course.rng.uniform(-math.pi, math.pi)
    way = course.pursue(path, heading, lambda at: at + math.remainder(seat.yaw_rad - at, math.tau), pace)
    stand, seated = seat.ahead(STAND_OFF_M), seat.ahead(-depth_m)
    if way.arrived is None:
        return None
    here = way.xy[way.arrived]
    back_s = max(0.3, math.dist(here, stand) / STEP_SPEED_M_S)
    walked_s = way.arrived / RATE_HZ
    down_at_s = walked_s + back_s + 2.0 * STILL_S
    total_s = down_at_s + down_s + ranges.hold_s + _SEATED_MARGIN_S
    if total_s > duration_s:
        return None
    at = times(total_s)
    frame = np.minimum(np.arange(len(at)), way.arrived)
    back = eased((at - walked_s) / back_s)
    sit = eased((at - down_at_s) / down_s)
    # Arms forward, lean into the movement, and come upright again once seated.
    reach = eased((at - down_at_s + 0.6) / (0.6 * down_s))
    forward = eased((at - down_at_s + 0.4) / (0.6 * down_s))
    upright = eased((at - down_at_s - 0.7 * down_s) / (0.8 * down_s))
    return RootTrajectory(
        "sit_on",
        way.xy[frame] + back[:, None] * (stand - here),
        way.yaw[frame],
        way.speed[frame],
        seated,
        np.zeros(len(at)),
        lean_rad * (forward - upright),
        REACH_RAD * reach,
        sit,
        seat,
        depth_m,
    )


BEHAVIOUR = Behaviour(SitOn, "Walk to a seat, turn, sit down and look around.", plan, needs_legs=True, place=4)

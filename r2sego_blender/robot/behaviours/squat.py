"""Stand, lower the body and look down, as for reaching."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...config.fields import Range, setting
from .behaviour import Behaviour, Course
from .trajectory import REACH_RAD, STILL_S, RootTrajectory, eased, times

# Time for lowering the body, and for rising.
_CROUCH_S = 1.4


@dataclass(frozen=True)
class Squat:
    """Ranges of the squat."""

    height: Range = setting((0.6, 0.85), "Lowest height, share of the standing height.", 0.4, 1.0)
    lean_deg: Range = setting((10.0, 25.0), "Lean of the waist, forward.", -25.0, 60.0)
    hold_s: Range = setting((0.5, 2.0), "How long it stays low.", 0.0, 60.0)


def plan(course: Course) -> RootTrajectory:
    """Down and up again, as often as there is time, with the arms reaching forward."""
    ranges = course.scope.squat
    place, heading = course.stand()
    at = times(course.scope.episode.duration_s)
    crouch, lean, reach = np.zeros((3, len(at)))
    begins_s = STILL_S
    while True:
        depth = 1.0 - course.draw(ranges.height)
        lean_rad = math.radians(course.draw(ranges.lean_deg))
        rise_s = begins_s + _CROUCH_S + course.draw(ranges.hold_s)
        if rise_s + _CROUCH_S > at[-1]:
            break
        low = eased((at - begins_s) / _CROUCH_S) - eased((at - rise_s) / _CROUCH_S)
        crouch, lean, begins_s = crouch + depth * low, lean + lean_rad * low, rise_s + _CROUCH_S + STILL_S
        reach = reach + (abs(lean_rad) or 1.0) * low  # forward, whichever way the body leans, if it does
    still = np.zeros(len(at))
    return RootTrajectory(
        "squat",
        np.tile(place, (len(at), 1)),
        np.full(len(at), heading),
        still,
        place,
        crouch,
        lean,
        REACH_RAD * reach / max(reach.max(), 1e-9),
        still,
    )


BEHAVIOUR = Behaviour(Squat, "Stand, lower the body and look down, as for reaching.", plan, needs_legs=True, place=3)

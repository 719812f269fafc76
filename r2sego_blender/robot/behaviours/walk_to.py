"""Walk to a place, looking around."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...config.fields import Range, setting
from .behaviour import Behaviour, Course
from .trajectory import RootTrajectory


@dataclass(frozen=True)
class WalkTo:
    """Ranges of the walk."""

    distance_m: Range = setting((0.6, 3.5), "Length of the path.", 0.1, 50.0)
    speed_m_s: Range = setting((0.35, 0.7), "Walking speed.", 0.05, 1.2)
    turn_rate_deg_s: Range = setting((50.0, 90.0), "Bound of the turning rate.", 5.0, 180.0)


def plan(course: Course) -> RootTrajectory | None:
    """A walk to a place within reach, and a turn there."""
    start = course.cell()
    pace = course.pace()
    turn = math.radians(course.draw(course.scope.look_around.turn_deg))
    path = course.path(start, pace[0])
    if path is None:
        return None
    way = course.pursue(path, course.heading(path), lambda at: at + turn, pace)
    return RootTrajectory.upright("walk_to", way.xy, way.yaw, way.speed, path[-1])


BEHAVIOUR = Behaviour(WalkTo, "Walk to a place, looking around.", plan, weight=0.7, place=0)

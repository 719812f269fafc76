"""Stand, turn and look around."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...config.fields import Range, setting
from .behaviour import Behaviour, Course
from .trajectory import RootTrajectory


@dataclass(frozen=True)
class LookAround:
    """Ranges of the looking body."""

    turn_deg: Range = setting((-160.0, 160.0), "Turn of the body on the spot.", -360.0, 360.0)


def plan(course: Course) -> RootTrajectory:
    """A turn on the spot, anywhere on the free floor."""
    place, heading = course.stand()
    _, turn_rate = course.pace()
    turn = math.radians(course.draw(course.scope.look_around.turn_deg))
    way = course.pursue(place[None], heading, lambda at: at + turn, (0.0, turn_rate))
    return RootTrajectory.upright("look_around", way.xy, way.yaw, way.speed, place)


BEHAVIOUR = Behaviour(LookAround, "Stand, turn and look around.", plan, weight=0.3, place=1)

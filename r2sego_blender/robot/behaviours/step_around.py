"""Step aside, forward and back, facing one way."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...config.fields import Range, setting
from .behaviour import Behaviour, Course
from .trajectory import RATE_HZ, STEP_SPEED_M_S, RootTrajectory, eased, times


@dataclass(frozen=True)
class StepAround:
    """Ranges of the small steps."""

    step_m: Range = setting((0.15, 0.45), "Length of one displacement.", 0.05, 1.5)
    pause_s: Range = setting((0.5, 1.5), "Standing between two.", 0.0, 60.0)


def plan(course: Course) -> RootTrajectory:
    """Displacements in any direction, with the heading kept; those off the free floor are left out."""
    ranges = course.scope.step_around
    place, heading = course.stand()
    at = times(course.scope.episode.duration_s)
    xy, begins_s = np.tile(place, (len(at), 1)), 0.0
    while True:
        begins_s += max(course.draw(ranges.pause_s), 1.0 / RATE_HZ)  # else a place without room is asked for ever
        length_m, direction = course.draw(ranges.step_m), course.rng.uniform(-math.pi, math.pi)
        target = place + length_m * np.array([math.cos(direction), math.sin(direction)])
        seconds = length_m / STEP_SPEED_M_S
        if begins_s + seconds > at[-1]:
            break
        if course.is_free_between(place, target):
            xy += eased((at - begins_s) / seconds)[:, None] * (target - place)
            place, begins_s = target, begins_s + seconds
    speed = np.linalg.norm(np.gradient(xy, 1.0 / RATE_HZ, axis=0), axis=1)
    return RootTrajectory.upright("step_around", xy, np.full(len(at), heading), speed, place)


BEHAVIOUR = Behaviour(StepAround, "Step aside, forward and back, facing one way.", plan, place=2)

"""The course that a declared behaviour is drawn on: a room's free floor and seats, and a scope's ranges."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...config.fields import Range
from ...core.errors import RobotError
from ..behaviours import behaviour
from ..behaviours.registry import BEHAVIOURS
from ..behaviours.trajectory import Pursuit, RootTrajectory, Seat
from ..model.model import RobotModel
from ..scope.scope import BehaviourScope
from .free_floor import FreeFloor
from .navigation import draw_cell, draw_path, line_is_free, path_between, pursue


def plan_root(
    floor: FreeFloor, scope: BehaviourScope, rng: np.random.Generator, seats: Sequence[Seat] = ()
) -> RootTrajectory | None:
    """Draw a behaviour and its trajectory.

    None when no reachable place lies in the scope's ranges.
    """
    weights = np.cumsum(dataclasses.astuple(scope.behaviours))
    drawn = BEHAVIOURS[int(np.searchsorted(weights, rng.random() * weights[-1], side="right"))]
    return drawn.plan(Course(floor, scope, rng, seats))


def require_legs(robot: RobotModel, scope: BehaviourScope) -> None:
    """Raises RobotError where ``scope`` declares a behaviour that takes legs of a robot without any."""
    for one in BEHAVIOURS:
        if one.needs_legs and robot.is_wheeled and getattr(scope.behaviours, one.name) > 0.0:
            raise RobotError(
                f"behaviours.{one.name} takes legs, and {robot.source} has none",
                where=scope.name,
                cure="Set it to 0, or give a robot with legs.",
            )


def draw(limits: Range, rng: np.random.Generator) -> float:
    """A uniform draw from a scope's range."""
    return float(rng.uniform(*limits))


@dataclass(frozen=True)
class Course(behaviour.Course):
    """A ``Course`` over the free floor of a room."""

    floor: FreeFloor
    scope: BehaviourScope
    rng: np.random.Generator
    seats: Sequence[Seat]

    def draw(self, limits: Range) -> float:
        return draw(limits, self.rng)

    def cell(self) -> tuple[int, int]:
        return draw_cell(self.floor.free, self.rng)

    def stand(self) -> tuple[np.ndarray, float]:
        row, column = self.cell()
        place = self.floor.points(np.array(row), np.array(column))
        return place, self.rng.uniform(-math.pi, math.pi)

    def pace(self) -> tuple[float, float]:
        walk = self.scope.walk_to
        return self.draw(walk.speed_m_s), math.radians(self.draw(walk.turn_rate_deg_s))

    def path(self, start: tuple[int, int], speed_m_s: float) -> np.ndarray | None:
        return draw_path(self.floor, start, self.scope, speed_m_s, self.rng)

    def path_to(self, place: np.ndarray, start: tuple[int, int]) -> np.ndarray | None:
        row, column = self.floor.cells(place)
        return path_between(self.floor, start, (int(row), int(column)))

    def heading(self, path: np.ndarray) -> float:
        ahead = path[min(len(path) - 1, 4)] - path[0]
        return math.atan2(ahead[1], ahead[0]) + math.radians(self.draw(self.scope.start.heading_offset_deg))

    def pursue(
        self, path: np.ndarray, heading: float, final: Callable[[float], float], pace: tuple[float, float]
    ) -> Pursuit:
        return pursue(path, heading, final, *pace, self.scope.episode.duration_s)

    def is_free_between(self, start: np.ndarray, end: np.ndarray) -> bool:
        return line_is_free(self.floor.is_free, start, end)

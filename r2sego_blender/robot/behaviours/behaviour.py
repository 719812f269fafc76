"""What a behaviour is: ranges to draw from, whether it takes legs, and how a course draws it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ...config.fields import Range
from .trajectory import Pursuit, RootTrajectory, Seat


class Course(Protocol):
    """What a behaviour is drawn on: a room's floor and ``seats``, the ranges of a ``scope``, an ``rng``.

    Places are (2,) world x and y in metres, cells (row, column) of the free floor. What it draws it
    draws from ``rng``, in the order of the calls.
    """

    scope: Any
    seats: Sequence[Seat]
    rng: np.random.Generator

    def draw(self, limits: Range) -> float:
        """A uniform draw from a range of the scope."""

    def cell(self) -> tuple[int, int]:
        """A free cell, all alike."""

    def stand(self) -> tuple[np.ndarray, float]:
        """A place on the free floor, and a heading (rad)."""

    def pace(self) -> tuple[float, float]:
        """A walking speed (m/s) and a turning rate (rad/s)."""

    def path(self, start: tuple[int, int], speed_m_s: float) -> np.ndarray | None:
        """(n, 2) a path from a cell to a goal in the scope's distances; None where there is none."""

    def path_to(self, place: np.ndarray, start: tuple[int, int]) -> np.ndarray | None:
        """(n, 2) a path from a cell to a place; None where none leads there."""

    def heading(self, path: np.ndarray) -> float:
        """The heading (rad) that a walk along a path (n, 2) starts with."""

    def pursue(
        self, path: np.ndarray, heading: float, final: Callable[[float], float], pace: tuple[float, float]
    ) -> Pursuit:
        """Walk ``path`` (n, 2) from ``heading``, then turn to ``final`` of the heading at its end."""

    def is_free_between(self, start: np.ndarray, end: np.ndarray) -> bool:
        """Whether the straight line between two places lies on the free floor."""


@dataclass(frozen=True)
class Behaviour:
    """A behaviour that a scope may declare, as its module says it.

    ``parameters`` is a frozen dataclass of ``setting`` fields with defaults, the scope's section;
    ``doc`` and ``weight`` say what it is and how often it is drawn by default. ``plan`` draws its
    trajectory; None where the course offers no goal. ``place`` is that in the list: what has none
    comes last, in the order of the names, and is drawn only where a scope says so.
    """

    parameters: type
    doc: str
    plan: Callable[[Course], RootTrajectory | None]
    needs_legs: bool = False
    weight: float = 0.0
    place: int | None = None
    name: str = ""

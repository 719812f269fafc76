"""The privileged state: what the simulator knows and no observation holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...robot.behaviours.trajectory import Seat


@dataclass(frozen=True, eq=False)
class PrivilegedState:
    """The true state of an episode.

    ``base_xy_m`` (2,) float64 and ``base_height_m`` are the base's place, world metres, ``yaw_rad`` its heading.
    ``seat`` is where to sit, None where the task is to walk; ``goal_xy_m`` (2,) where the base has to end, None
    for anywhere. ``is_seated`` and ``seated_s``: whether the seat carries the robot, and for how long by now.
    ``time_s`` is the episode's, ``mean_assist_n`` the mean size of the helping force since its start; ``failure``
    is empty as long as nothing failed.
    """

    base_xy_m: np.ndarray
    yaw_rad: float
    base_height_m: float
    seat: Seat | None
    goal_xy_m: np.ndarray | None
    is_seated: bool
    seated_s: float
    time_s: float
    mean_assist_n: float
    failure: str

    def __eq__(self, other: object) -> bool:
        """Whether all numbers are the same."""
        if not isinstance(other, PrivilegedState):
            return NotImplemented
        pairs = ((vars(self)[name], vars(other)[name]) for name in vars(self))
        return all(np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b for a, b in pairs)

    __hash__ = None  # type: ignore[assignment]  # arrays have none

"""Ways to one place from everywhere: the least cost over the free floor, found once."""

from __future__ import annotations

import math

import numpy as np
from skimage.graph import MCP_Geometric

from ...robot.planning.free_floor import CELL_M, FreeFloor
from ...robot.planning.navigation import line_is_free

# A cell at the edge of the free floor costs this much more than one in the open, and one that is not free
# more than any way around: who stands there goes back to the free floor first.
_EDGE_COST, _EDGE_REACH_M = 3.0, 0.35
_NOT_FREE_COST = 200.0


class CostToGo:
    """The ways of ``floor`` to ``goal`` (2,), a place on the free floor."""

    def __init__(self, floor: FreeFloor, goal: np.ndarray) -> None:
        self._floor, self.goal = floor, np.asarray(goal, float)
        edge = 1.0 - np.clip(floor.clearance_m / _EDGE_REACH_M, 0.0, 1.0)
        costs = np.where(floor.free, 1.0 + _EDGE_COST * edge, _NOT_FREE_COST)
        self._search = MCP_Geometric(costs, fully_connected=True)
        row, column = floor.cells(self.goal)
        self._search.find_costs([(int(row), int(column))])

    def way(self, place: np.ndarray) -> np.ndarray:
        """The way (n, 2) from ``place`` (2,), a point a cell; the goal is its last."""
        row, column = self._floor.cells(place)
        cells = np.array(self._search.traceback((int(row), int(column))))[::-1]
        way = self._floor.points(*cells.T)
        way[0], way[-1] = place, self.goal
        return way

    def aim(self, place: np.ndarray, reach_m: float) -> tuple[np.ndarray, float]:
        """The farthest point (2,) within ``reach_m`` of way that lies straight ahead, and how long the way is."""
        way = self.way(place)
        steps_m = np.linalg.norm(np.diff(way, axis=0), axis=1)
        ahead = max(1, min(len(way) - 1, math.ceil(reach_m / CELL_M)))
        while ahead > 1 and not line_is_free(self._floor.is_free, place, way[ahead]):
            ahead -= 1
        return way[min(ahead, len(way) - 1)], float(steps_m.sum())

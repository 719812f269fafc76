"""Ways over the free floor: least-cost paths, pursued with bounded speed and turns."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy import ndimage
from skimage.graph import MCP_Geometric

from ..behaviours.trajectory import RATE_HZ, Pursuit, Seat
from ..scope.scope import BehaviourScope
from .free_floor import CELL_M, FreeFloor

_ACCELERATION_M_S2 = 0.7
_TURN_ACCELERATION_RAD_S2 = 4.0
_TURN_GAIN = 4.0  # 1/s: turning rate for a heading error
# Beyond this heading error the robot turns on the spot.
_WALK_WITHIN_RAD = math.radians(50.0)
_LOOK_AHEAD_M = 0.18
_ARRIVED_M, _FACING_RAD = 0.03, 0.02
# Share of the episode that a walk may fill; the rest is for turning towards the path.
_WALKING_SHARE = 0.8
# A cell at the edge of the free floor costs this much more than one in the open.
_EDGE_COST = 2.0
_EDGE_REACH_M = 0.25


def draw_cell(free: np.ndarray, rng: np.random.Generator) -> tuple[int, int]:
    """Row and column of one of the ``free`` cells (ny, nx), all alike."""
    rows, columns = np.nonzero(free)
    index = int(rng.integers(len(rows)))
    return int(rows[index]), int(columns[index])


def draw_path(
    floor: FreeFloor, start: tuple[int, int], scope: BehaviourScope, speed_m_s: float, rng: np.random.Generator
) -> np.ndarray | None:
    """A smooth path (n, 2), about ``CELL_M`` between points, to a goal drawn in the scope's range.

    None where no place lies in it.
    """
    search, costs = _costs(floor, start)
    length_m = costs * CELL_M  # an upper bound of the length: costs are at least 1 a cell
    low, high = scope.walk_to.distance_m
    high = min(high, _WALKING_SHARE * speed_m_s * scope.episode.duration_s)
    goals = np.isfinite(costs) & (length_m >= low) & (length_m <= high)
    if not goals.any():
        return None
    goal = draw_cell(goals, rng)
    return _smoothed(floor, floor.points(*np.array(search.traceback(goal)).T))


def path_between(floor: FreeFloor, start: tuple[int, int], goal: tuple[int, int]) -> np.ndarray | None:
    """A smooth path (n, 2) between two free cells; None where they are not connected."""
    search, costs = _costs(floor, start)
    if not np.isfinite(costs[goal]):
        return None
    return _smoothed(floor, floor.points(*np.array(search.traceback(goal)).T))


def ways_from(floor: FreeFloor, rows: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The nearest of some cells (n,), by its index, and the length of the way from it, for every cell (ny, nx).

    A way is the one of least cost, along which an upper bound of its length is measured in metres; -1 and inf
    where there is none. Cells that are not free lead nowhere.
    """
    search = _search(floor)
    free = np.flatnonzero(floor.free[rows, columns])
    nearest, length_m = np.full(floor.free.shape, -1), np.full(floor.free.shape, np.inf)
    for index in free:  # a cell once, however many of them share it
        nearest[rows[index], columns[index]] = index
    starts = np.argwhere(nearest >= 0)
    if not len(starts):
        return nearest, length_m
    costs, back = search.find_costs(starts)
    reached = np.isfinite(costs)
    length_m[reached] = costs[reached] * CELL_M
    offsets = np.array(search.offsets)
    for cell in np.argwhere(reached)[np.argsort(costs[reached], kind="stable")]:
        if back[tuple(cell)] >= 0:
            nearest[tuple(cell)] = nearest[tuple(cell - offsets[back[tuple(cell)]])]
    return nearest, length_m


def ways_to_seats(floor: FreeFloor, seats: Sequence[Seat]) -> tuple[np.ndarray, np.ndarray]:
    """``ways_from`` the places before ``seats``, where a robot turns."""
    return ways_from(floor, *floor.cells(np.array([seat.ahead(seat.approach_m) for seat in seats])))


def _costs(floor: FreeFloor, start: tuple[int, int]) -> tuple[MCP_Geometric, np.ndarray]:
    search = _search(floor)
    return search, search.find_costs([start])[0]


def _search(floor: FreeFloor) -> MCP_Geometric:
    edge = 1.0 - np.clip(floor.clearance_m / _EDGE_REACH_M, 0.0, 1.0)
    return MCP_Geometric(np.where(floor.free, 1.0 + _EDGE_COST * edge, -1.0), fully_connected=True)


def _smoothed(floor: FreeFloor, path: np.ndarray) -> np.ndarray:
    """The grid path with its corners cut where the straight line is free, then rounded."""
    corners, at = [path[0]], 0
    while at < len(path) - 1:
        ahead = len(path) - 1
        while ahead > at + 1 and not line_is_free(floor.is_free, path[at], path[ahead]):
            ahead -= 1
        corners.append(path[ahead])
        at = ahead
    taut = _resampled(np.array(corners))
    rounded = ndimage.gaussian_filter1d(taut, sigma=_LOOK_AHEAD_M / CELL_M, axis=0, mode="nearest")
    rounded[0], rounded[-1] = taut[0], taut[-1]
    return rounded if floor.is_free(rounded).all() else taut


def line_is_free(
    is_free: Callable[[np.ndarray], np.ndarray], start: np.ndarray, end: np.ndarray, cell_m: float = CELL_M
) -> bool:
    """Whether the straight line between two points (D,) lies in free cells, as ``is_free`` of (n, D)."""
    steps = max(2, math.ceil(math.dist(start, end) / (0.5 * cell_m)))
    return bool(is_free(start + np.linspace(0.0, 1.0, steps)[:, None] * (end - start)).all())


def _resampled(corners: np.ndarray) -> np.ndarray:
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    at = np.linspace(0.0, lengths[-1], max(2, math.ceil(lengths[-1] / CELL_M) + 1))
    return np.stack([np.interp(at, lengths, corners[:, axis]) for axis in (0, 1)], axis=1)


def pursue(
    path: np.ndarray,
    heading: float,
    final: Callable[[float], float],
    speed_m_s: float,
    turn_rate: float,
    duration_s: float,
) -> Pursuit:
    """Pursue ``path`` (n, 2) from ``heading``, then turn to ``final`` of the heading at its end."""
    frames = round(duration_s * RATE_HZ) + 1
    dt = 1.0 / RATE_HZ
    xy, yaw, speed = np.empty((frames, 2)), np.empty(frames), np.empty(frames)
    (x, y), angle, rate, forward = path[0], heading, 0.0, 0.0
    goal_x, goal_y = path[-1]
    nearest, reach = 0, max(1, round(_LOOK_AHEAD_M / CELL_M))
    target = final(heading) if len(path) == 1 else None
    arrived = None
    for frame in range(frames):
        xy[frame], yaw[frame], speed[frame] = (x, y), angle, forward
        left = math.hypot(goal_x - x, goal_y - y)
        if target is None and left < _ARRIVED_M:
            target = final(angle)
        if target is None:
            window = path[nearest : nearest + 2 * reach]
            nearest += int(np.argmin((window[:, 0] - x) ** 2 + (window[:, 1] - y) ** 2))
            aim_x, aim_y = path[min(nearest + reach, len(path) - 1)]
            error = math.remainder(math.atan2(aim_y - y, aim_x - x) - angle, math.tau)
            wanted = speed_m_s * max(0.0, 1.0 - abs(error) / _WALK_WITHIN_RAD)
            # Brake in time: only the last look-ahead's distance is straight to the goal.
            if nearest + reach >= len(path) - 1:
                wanted = min(wanted, math.sqrt(2.0 * _ACCELERATION_M_S2 * left) * 0.8)
        else:
            error, wanted = target - angle, 0.0
            if arrived is None and abs(error) < _FACING_RAD and forward == 0.0:
                arrived = frame
        # The turn rate from which the remaining error can still be braked.
        brakeable = math.sqrt(2.0 * _TURN_ACCELERATION_RAD_S2 * abs(error)) * 0.7
        bound = min(turn_rate, brakeable, _TURN_GAIN * abs(error))
        rate += _clip(math.copysign(bound, error) - rate, _TURN_ACCELERATION_RAD_S2 * dt)
        forward += _clip(wanted - forward, _ACCELERATION_M_S2 * dt)
        angle += rate * dt
        x += forward * math.cos(angle) * dt
        y += forward * math.sin(angle) * dt
    return Pursuit(xy, yaw, speed, arrived)


def _clip(value: float, bound: float) -> float:
    return max(-bound, min(bound, value))

"""Root trajectories: a least-cost path over the free floor, walked with bounded speed and turns."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from skimage.graph import MCP_Geometric

from .free_floor import CELL_M, FreeFloor
from .scope import BehaviourScope, Range

RATE_HZ = 50.0
"""Rate of reference motions."""

_ACCELERATION_M_S2 = 0.7
_TURN_ACCELERATION_RAD_S2 = 4.0
_TURN_GAIN = 4.0  # 1/s: turning rate for a heading error
# Beyond this heading error the robot turns on the spot.
_WALK_WITHIN_RAD = math.radians(50.0)
_LOOK_AHEAD_M = 0.18
_ARRIVED_M = 0.03
# Share of the episode that a walk may fill; the rest is for turning towards the path.
_WALKING_SHARE = 0.8
# A cell at the edge of the free floor costs this much more than one in the open.
_EDGE_COST = 2.0
_EDGE_REACH_M = 0.25


@dataclass(frozen=True)
class RootTrajectory:
    """The pelvis' reference on the floor at ``RATE_HZ``.

    ``xy`` (T, 2) metres, ``yaw`` (T,) radians, not wrapped, ``speed`` (T,) m/s; ``goal``
    (2,) is where the behaviour has to end.
    """

    behaviour: str
    xy: np.ndarray
    yaw: np.ndarray
    speed: np.ndarray
    goal: np.ndarray


def draw(limits: Range, rng: np.random.Generator) -> float:
    """A uniform draw from a scope's range."""
    return float(rng.uniform(*limits))


def plan_root(floor: FreeFloor, scope: BehaviourScope, rng: np.random.Generator) -> RootTrajectory | None:
    """Draw a behaviour, a start and a goal, and the root's way between them.

    None when no reachable place lies in the scope's range of distances.
    """
    weights = np.array([scope.behaviours.walk_to, scope.behaviours.look_around])
    behaviour = ("walk_to", "look_around")[int(rng.random() * weights.sum() >= weights[0])]
    start = _draw_cell(floor.free, rng)
    speed_m_s = draw(scope.walk_to.speed_m_s, rng)
    turn_rate = math.radians(draw(scope.walk_to.turn_rate_deg_s, rng))
    turn = math.radians(draw(scope.look_around.turn_deg, rng))
    heading = rng.uniform(-math.pi, math.pi)
    path = floor.points(*np.array([start]).T)
    if behaviour == "walk_to":
        walked = _draw_path(floor, start, scope, speed_m_s, rng)
        if walked is None:
            return None
        path = walked
        ahead = path[min(len(path) - 1, int(_LOOK_AHEAD_M / CELL_M) + 1)] - path[0]
        offset = math.radians(draw(scope.start.heading_offset_deg, rng))
        heading = math.atan2(ahead[1], ahead[0]) + offset
    xy, yaw, speed = _follow(path, heading, turn, speed_m_s, turn_rate, scope.episode.duration_s)
    return RootTrajectory(behaviour, xy, yaw, speed, path[-1])


def _draw_cell(free: np.ndarray, rng: np.random.Generator) -> tuple[int, int]:
    rows, columns = np.nonzero(free)
    index = int(rng.integers(len(rows)))
    return int(rows[index]), int(columns[index])


def _draw_path(
    floor: FreeFloor, start: tuple[int, int], scope: BehaviourScope, speed_m_s: float,
    rng: np.random.Generator,
) -> np.ndarray | None:  # fmt: skip
    """A smooth path (n, 2), about ``CELL_M`` between points, to a goal drawn in range."""
    edge = 1.0 - np.clip(floor.clearance_m / _EDGE_REACH_M, 0.0, 1.0)
    search = MCP_Geometric(np.where(floor.free, 1.0 + _EDGE_COST * edge, -1.0), fully_connected=True)
    costs, _ = search.find_costs([start])
    length_m = costs * CELL_M  # an upper bound of the length: costs are at least 1 a cell
    low, high = scope.walk_to.distance_m
    high = min(high, _WALKING_SHARE * speed_m_s * scope.episode.duration_s)
    goals = np.isfinite(costs) & (length_m >= low) & (length_m <= high)
    if not goals.any():
        return None
    goal = _draw_cell(goals, rng)
    path = floor.points(*np.array(search.traceback(goal)).T)
    return _smoothed(floor, path)


def _smoothed(floor: FreeFloor, path: np.ndarray) -> np.ndarray:
    """The grid path with its corners cut where the straight line is free, then rounded."""
    corners, at = [path[0]], 0
    while at < len(path) - 1:
        ahead = len(path) - 1
        while ahead > at + 1 and not _line_is_free(floor, path[at], path[ahead]):
            ahead -= 1
        corners.append(path[ahead])
        at = ahead
    taut = _resampled(np.array(corners))
    rounded = ndimage.gaussian_filter1d(taut, sigma=_LOOK_AHEAD_M / CELL_M, axis=0, mode="nearest")
    rounded[0], rounded[-1] = taut[0], taut[-1]
    return rounded if floor.is_free(rounded).all() else taut


def _line_is_free(floor: FreeFloor, start: np.ndarray, end: np.ndarray) -> bool:
    steps = max(2, math.ceil(math.dist(start, end) / (0.5 * CELL_M)))
    return bool(floor.is_free(start + np.linspace(0.0, 1.0, steps)[:, None] * (end - start)).all())


def _resampled(corners: np.ndarray) -> np.ndarray:
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    at = np.linspace(0.0, lengths[-1], max(2, math.ceil(lengths[-1] / CELL_M) + 1))
    return np.stack([np.interp(at, lengths, corners[:, axis]) for axis in (0, 1)], axis=1)


def _follow(
    path: np.ndarray, heading: float, turn: float, speed_m_s: float, turn_rate: float, duration_s: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pursue ``path`` from ``heading``, then turn by ``turn`` at its end."""
    frames = round(duration_s * RATE_HZ) + 1
    dt = 1.0 / RATE_HZ
    xy, yaw, speed = np.empty((frames, 2)), np.empty(frames), np.empty(frames)
    (x, y), angle, rate, forward = path[0], heading, 0.0, 0.0
    goal_x, goal_y = path[-1]
    nearest, reach = 0, max(1, round(_LOOK_AHEAD_M / CELL_M))
    final = heading + turn if len(path) == 1 else None
    for frame in range(frames):
        xy[frame], yaw[frame], speed[frame] = (x, y), angle, forward
        left = math.hypot(goal_x - x, goal_y - y)
        if final is None and left < _ARRIVED_M:
            final = angle + turn
        if final is None:
            window = path[nearest : nearest + 2 * reach]
            nearest += int(np.argmin((window[:, 0] - x) ** 2 + (window[:, 1] - y) ** 2))
            aim_x, aim_y = path[min(nearest + reach, len(path) - 1)]
            error = math.remainder(math.atan2(aim_y - y, aim_x - x) - angle, math.tau)
            wanted = speed_m_s * max(0.0, 1.0 - abs(error) / _WALK_WITHIN_RAD)
            # Brake in time: only the last look-ahead's distance is straight to the goal.
            if nearest + reach >= len(path) - 1:
                wanted = min(wanted, math.sqrt(2.0 * _ACCELERATION_M_S2 * left) * 0.8)
        else:
            error, wanted = final - angle, 0.0
        # The turn rate from which the remaining error can still be braked.
        brakeable = math.sqrt(2.0 * _TURN_ACCELERATION_RAD_S2 * abs(error)) * 0.7
        bound = min(turn_rate, brakeable, _TURN_GAIN * abs(error))
        rate += _clip(math.copysign(bound, error) - rate, _TURN_ACCELERATION_RAD_S2 * dt)
        forward += _clip(wanted - forward, _ACCELERATION_M_S2 * dt)
        angle += rate * dt
        x += forward * math.cos(angle) * dt
        y += forward * math.sin(angle) * dt
    return xy, yaw, speed


def _clip(value: float, bound: float) -> float:
    return max(-bound, min(bound, value))

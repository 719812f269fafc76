"""Where in a room a recorded motion fits: its root's path on the free floor, or its end on a seat."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from ..behaviours.trajectory import RATE_HZ, Seat
from ..model.composition import Composition
from ..model.kinematics import LegSolver
from ..model.model import RobotModel
from ..motion.foot_locking import foot_places, spans
from ..motion.sitting import seated_height
from ..planning.free_floor import CELL_M, FreeFloor
from .velocity_pursuit import heading_rad

_HEADINGS = 16
# Who cannot sit as deep as drawn sits nearer to the edge, by steps of this.
_SHALLOWER_M = 0.03
# The legs are solved anew in full once the base is lower by a tenth of the way.
_FROM_SHARE = 10.0
# A base that rests this low, as a share of its standing height, is seated.
_SEATED, _SEATED_M_S, _SEATED_S = 0.75, 0.15, 1.0


def placed_on_floor(qpos: np.ndarray, floor: FreeFloor, rng: np.random.Generator) -> np.ndarray | None:
    """``qpos`` (T, nq), turned about the vertical and moved so that its root keeps to the free floor.

    All places on the grid are considered for each of some drawn headings, all places alike;
    None where there is none.
    """
    for turn in rng.uniform(-math.pi, math.pi, _HEADINGS):
        turned = moved(qpos, turn, np.zeros(2))
        cells = np.unique(np.rint((turned[:, :2] - turned[0, :2]) / CELL_M).astype(int), axis=0)
        fits = np.ones_like(floor.free)
        for column, row in cells:
            fits &= _shifted(floor.free, row, column)
        rows, columns = np.nonzero(fits)
        if len(rows):
            chosen = int(rng.integers(len(rows)))
            place = floor.points(rows[chosen], columns[chosen])
            return moved(qpos, turn, place - turned[0, :2], floor.floor_z_m)
    return None


def placed_on_seat(
    qpos: np.ndarray,
    robot: RobotModel,
    composition: Composition,
    floor: FreeFloor,
    seat: Seat,
    depth_m: float,
    shortest: int,
) -> np.ndarray | None:
    """``qpos`` (T, nq), which ends seated, moved so that it ends ``depth_m`` behind the seat's edge.

    The base is lowered or lifted to the seat's height as it sits down, the feet staying where
    they are; where they would not reach the floor it sits nearer to the edge. What comes
    before the base is for good on the free floor or the seat is left out. None where fewer
    than ``shortest`` frames remain, or the feet do not reach at all.
    """
    turned = moved(qpos, seat.yaw_rad - heading_rad(qpos[-1]), np.zeros(2), floor.floor_z_m)
    for shallower_m in np.arange(depth_m, 0.0, -_SHALLOWER_M):
        found = moved(turned, 0.0, seat.ahead(-shallower_m) - turned[-1, :2])
        near = np.array([seat.is_near(place) for place in found[:, :2]])
        outside = np.flatnonzero(~(floor.is_free(found[:, :2]) | near))
        found = found[outside[-1] + 1 :] if len(outside) else found
        if len(found) >= shortest and _sit(found, robot, composition, floor, seat):
            return found
    return None


def _sit(qpos: np.ndarray, robot: RobotModel, composition: Composition, floor: FreeFloor, seat: Seat) -> bool:
    """Bring the base of ``qpos`` (T, nq) to the seat's height as it sits down; False: out of reach."""
    soles, _ = foot_places(robot, qpos)
    upright = qpos[-1].copy()
    upright[2] = standing_m = floor.floor_z_m + robot.rest_height_m
    seated_m = seated_height(robot, composition, upright, soles[:, -1], seat)
    if seated_m is None:
        return False
    share = np.clip((standing_m - qpos[:, 2]) / (standing_m - qpos[-1, 2]), 0.0, 1.0)
    qpos[:, 2] += share * (seated_m - qpos[-1, 2])
    solved = qpos.copy()
    LegSolver(robot).solve(solved, soles)
    part = np.clip(_FROM_SHARE * share, 0.0, 1.0)[:, None]
    qpos[:] = (1.0 - part) * qpos + part * solved
    return True


def seated_span(qpos: np.ndarray, robot: RobotModel) -> tuple[int, int] | None:
    """First and last frame of the longest rest of ``qpos`` (T, nq) on a seat; None where it never sits."""
    speed = np.linalg.norm(np.gradient(qpos[:, :3], 1.0 / RATE_HZ, axis=0), axis=1)
    rests = (qpos[:, 2] < _SEATED * robot.rest_height_m) & (speed < _SEATED_M_S)
    found = spans(rests)
    if not len(found):
        return None
    begin, end = found[np.argmax(found[:, 1] - found[:, 0])]
    return (int(begin), int(end) - 1) if end - begin >= _SEATED_S * RATE_HZ else None


def moved(qpos: np.ndarray, turn_rad: float, by_m: np.ndarray, up_m: float = 0.0) -> np.ndarray:
    """``qpos`` (T, nq) turned about the world's z axis, then moved by ``by_m`` (2,) and ``up_m``."""
    found = qpos.copy()
    turn = Rotation.from_euler("z", turn_rad)
    found[:, :3] = turn.apply(qpos[:, :3]) + np.array([*by_m, up_m])
    found[:, 3:7] = (turn * Rotation.from_quat(qpos[:, 3:7], scalar_first=True)).as_quat(scalar_first=True)
    return found


def _shifted(free: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """Cells whose neighbour ``rows`` and ``columns`` on is free; none beyond the grid."""
    found = np.zeros_like(free)
    height, width = free.shape
    if abs(rows) >= height or abs(columns) >= width:
        return found
    into = (slice(max(0, -rows), height - max(0, rows)), slice(max(0, -columns), width - max(0, columns)))
    found[into] = free[max(0, rows) : height + min(0, rows), max(0, columns) : width + min(0, columns)]
    return found

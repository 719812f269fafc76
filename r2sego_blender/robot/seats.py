"""Places to sit: level surfaces of seat height with an open front, found on the collision surface."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from scipy import ndimage

from ..errors import RobotError
from .composition import compile_scene, scene_spec
from .free_floor import CELL_M, FreeFloor
from .scope import ANY_SEAT, SitOn

_CELL_M = 0.025
# Heights are looked for downwards from here: what hangs higher is above a seated head.
_FROM_M = 1.25
_MARGIN_M = 0.6
_HEADINGS = 24
# A surface is level where neighbouring cells differ by less than this.
_STEP_M = 0.02
# Room for the hips: half the width of a seat, how deep it is, and its smallest area.
_HALF_WIDTH_M, _DEPTH_M, _MIN_AREA_M2 = 0.14, 0.2, 0.06
# A seat's rim may be round or worn for this much before its front edge.
_RIM_M = 0.1
# What is lower than this is floor; the way to the seat is free for the arms to either side.
_FLOOR_M, _HALF_BODY_M = 0.06, 0.24
# Beside the seated body, as deep as it, nothing rises above the seat by more than this.
_ELBOW_M, _HALF_ARMS_M, _TORSO_M = 0.08, 0.3, 0.3
# A backrest rises by this much within this distance behind the seated pelvis.
_BACK_RISE_M, _BACK_REACH_M = 0.15, 0.55
STAND_OFF_M = 0.14
"""From the seat's front edge to the pelvis that stands before it, about to sit down."""
_HOLDS_M, _HOLDS_ABOVE_M = 0.45, 0.08
# The farthest that a robot steps back to a seat.
_APPROACHES_M = np.arange(0.2, 1.001, 0.025)
# A target named by a place means a seat no farther away than this.
_TARGET_M = 0.8


@dataclass(frozen=True)
class Seat:
    """A place to sit, looking along ``yaw_rad``, away from the backrest where there is one.

    ``edge_m`` (2,) is the point of the front edge in the middle before the seated robot,
    world x and y, metres; ``height_m`` the world z of the surface; ``approach_m`` how far
    before the edge the free floor begins, where a robot can turn; ``surface`` numbers the
    surfaces: a sofa is one, with many places.
    """

    edge_m: tuple[float, float]
    height_m: float
    yaw_rad: float
    approach_m: float
    surface: int = 0

    def ahead(self, distance_m: float) -> np.ndarray:
        """(2,) the point ``distance_m`` before the front edge; negative: on the seat."""
        return np.array(self.edge_m) + distance_m * np.array([np.cos(self.yaw_rad), np.sin(self.yaw_rad)])

    def holds(self, points: np.ndarray) -> np.ndarray:
        """(n,) bool: which contact points (n, 3) belong to sitting here."""
        near = np.linalg.norm(points[:, :2] - self.ahead(-0.1), axis=1) < _HOLDS_M
        return near & (points[:, 2] < self.height_m + _HOLDS_ABOVE_M)

    def is_near(self, point: np.ndarray) -> bool:
        """Whether (2,) is on the seat or on the last step towards it."""
        return bool(np.linalg.norm(np.asarray(point) - self.edge_m) < self.approach_m + 0.1)


def find_seats(floor: FreeFloor, sit_on: SitOn, collision_mjcf: Path) -> tuple[Seat, ...]:
    """Every seat that ``sit_on`` admits and that the free floor leads to.

    A seat is a level surface of an admitted height, as wide as the hips, whose front falls
    to open floor; where a surface has backrests only places before one are taken. Raises
    RobotError when there is none.
    """
    heights, origin = _height_map(floor, collision_mjcf)
    seats = _seats(heights - floor.floor_z_m, origin, floor, sit_on)
    if sit_on.target != ANY_SEAT and seats:
        away = np.array([np.linalg.norm(np.subtract(seat.edge_m, sit_on.target)) for seat in seats])
        wanted = seats[int(away.argmin())].surface if away.min() <= _TARGET_M else -1
        seats = tuple(seat for seat in seats if seat.surface == wanted)
    if not seats:
        low, high = sit_on.height_m
        where = "" if sit_on.target == ANY_SEAT else f" at {sit_on.target}"
        raise RobotError(
            f"there is no seat{where} from {low:.2f} to {high:.2f} m high with open floor before it",
            where=collision_mjcf,
            cure="Check the collision surface, or give the scope another sit_on.target or sit_on.height_m.",
        )
    return seats


def _height_map(floor: FreeFloor, collision_mjcf: Path) -> tuple[np.ndarray, np.ndarray]:
    """(ny, nx) float64 world z of the first surface below ``_FROM_M``, nan for none; and cell (0, 0)."""
    model = compile_scene(scene_spec(collision_mjcf), collision_mjcf)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    origin = floor.origin_m - _MARGIN_M
    size = (np.array(floor.free.shape)[::-1] - 1) * CELL_M + 2.0 * _MARGIN_M
    columns, rows = (np.floor(size / _CELL_M).astype(int) + 1).tolist()
    heights = np.full((rows, columns), np.nan)
    down, touched, from_z = np.array([0.0, 0.0, -1.0]), np.zeros(1, np.int32), floor.floor_z_m + _FROM_M
    start = np.array([0.0, 0.0, from_z])
    for row, column in np.ndindex(rows, columns):
        start[:2] = origin + _CELL_M * np.array([column, row])
        distance = mujoco.mj_ray(model, data, start, down, None, 1, -1, touched)
        if distance >= 0.0:
            heights[row, column] = from_z - distance
    return heights, origin


def _seats(heights: np.ndarray, origin: np.ndarray, floor: FreeFloor, sit_on: SitOn) -> tuple[Seat, ...]:
    """Seats on a map of heights above the floor: every place on a front edge, every heading."""
    low, high = sit_on.height_m
    known = np.nan_to_num(heights, nan=-1.0)
    rise = ndimage.maximum_filter(known, 3) - ndimage.minimum_filter(known, 3)
    level = (known >= low) & (known <= high) & (rise < _STEP_M)
    surface, _ = ndimage.label(level)
    enough = np.bincount(surface.ravel()) * _CELL_M**2 >= _MIN_AREA_M2
    enough[0] = False
    rows, columns = np.nonzero(enough[surface])
    if not len(rows):
        return ()
    points = origin + _CELL_M * np.stack([columns, rows], axis=1)
    level_m = known[rows, columns]
    found = [
        _facing(known, surface, origin, points, level_m, yaw, floor)
        for yaw in np.linspace(0.0, 2.0 * np.pi, _HEADINGS, endpoint=False)
    ]
    seats = [seat for group, _ in found for seat in group]
    backed = np.array([backed for _, group in found for backed in group], bool)
    with_back = {seat.surface for seat, back in zip(seats, backed, strict=True) if back}
    return tuple(
        seat for seat, back in zip(seats, backed, strict=True) if back or seat.surface not in with_back
    )


def _facing(
    heights: np.ndarray, surface: np.ndarray, origin: np.ndarray, points: np.ndarray,
    level_m: np.ndarray, yaw: float, floor: FreeFloor,
) -> tuple[list[Seat], list[bool]]:  # fmt: skip
    """The front edges that face along ``yaw``, and whether a backrest is behind each."""
    ahead = np.array([np.cos(yaw), np.sin(yaw)])
    aside = np.array([-ahead[1], ahead[0]])

    def at(forward_m: float | np.ndarray, left_m: float, values: np.ndarray = heights) -> np.ndarray:
        """``values`` (n,) beside the points, of the map of heights or another."""
        place = points + np.multiply.outer(forward_m, ahead) + left_m * aside
        index = np.rint((place - origin) / _CELL_M).astype(int)
        inside = ((index >= 0) & (index < np.array(heights.shape)[::-1])).all(axis=1)
        clipped = np.clip(index, 0, np.array(heights.shape)[::-1] - 1)
        return np.where(inside, values[clipped[:, 1], clipped[:, 0]], -1.0)

    labels = at(0.0, 0.0, surface)
    hips = np.arange(-_HALF_WIDTH_M, _HALF_WIDTH_M + 1e-9, 0.04)
    body = np.arange(-_HALF_BODY_M, _HALF_BODY_M + 1e-9, 0.04)
    # Only the foremost level cells; before them the rim, then floor.
    is_seat = at(_CELL_M, 0.0, surface) != labels
    for back_m in np.arange(0.0, _DEPTH_M, _CELL_M):
        for left_m in hips:
            is_seat &= np.abs(at(-back_m, left_m) - level_m) < 2.0 * _STEP_M
    rim_m = np.full(len(points), np.inf)
    for forward_m in np.arange(0.0, _RIM_M + 1e-9, _CELL_M)[::-1]:
        is_floor = np.max([at(forward_m + _CELL_M, left_m) for left_m in hips], axis=0) < _FLOOR_M
        rim_m[is_floor] = forward_m
        is_seat &= np.max([at(forward_m, left_m) for left_m in hips], axis=0) < level_m + 2.0 * _STEP_M
    is_seat &= np.isfinite(rim_m)
    for back_m in np.arange(0.0, _TORSO_M, 2.0 * _CELL_M):
        for left_m in (-_HALF_ARMS_M, -0.5 * _HALF_ARMS_M, 0.5 * _HALF_ARMS_M, _HALF_ARMS_M):
            is_seat &= at(-back_m, left_m) < level_m + _ELBOW_M
    edge_m = np.where(is_seat, rim_m, 0.0) + 0.5 * _CELL_M
    approach_m = np.full(len(points), np.inf)
    is_open = is_seat.copy()
    for before_m in np.arange(_CELL_M, _APPROACHES_M[-1], _CELL_M):
        is_open &= np.max([at(edge_m + before_m, left_m) for left_m in body], axis=0) < _FLOOR_M
        is_free = floor.is_free(points + (edge_m + before_m)[:, None] * ahead) & is_open
        approach_m = np.where(
            is_free & (before_m >= _APPROACHES_M[0]), np.minimum(approach_m, before_m), approach_m
        )
    is_seat &= np.isfinite(approach_m)
    behind = [at(-back_m, 0.0) for back_m in np.arange(_DEPTH_M, _BACK_REACH_M, _CELL_M)]
    backed = np.max(behind, axis=0) > level_m + _BACK_RISE_M
    chosen = np.flatnonzero(is_seat)
    edges = points + edge_m[:, None] * ahead
    seats = [
        Seat(tuple(edges[one].tolist()), float(level_m[one] + floor.floor_z_m), float(yaw),
             float(approach_m[one]), int(labels[one]))
        for one in chosen
    ]  # fmt: skip
    return seats, backed[chosen].tolist()

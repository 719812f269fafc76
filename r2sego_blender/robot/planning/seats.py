"""Places to sit: level surfaces of seat height with an open front, found on the collision surface."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from scipy import ndimage

from ...core.errors import RobotError
from ..behaviours.sit_on import ANY_SEAT, SitOn
from ..behaviours.trajectory import Seat
from ..model.composition import compile_scene, scene_spec
from .free_floor import CELL_M, FreeFloor

_CELL_M = 0.025
TURN_M = 0.5
"""A turn by a radian counts like a step of this, where places to sit are compared."""

# Heights are looked for downwards from here: what hangs higher is above a seated head.
_FROM_M = 1.25
_MARGIN_M = 0.6
_HEADINGS = 72
# A surface is level where neighbouring cells differ by less than this.
_STEP_M = 0.02
# The seated body, in shares of the robot's half width: hips, and arms held forward.
_HIPS, _ARMS = 0.5, 0.83
# How deep a seat is at least, its smallest area, and how deep the body beside its edge.
_DEPTH_M, _MIN_AREA_M2, _TORSO_M = 0.2, 0.06, 0.24
# Beside the seated body nothing rises above the seat by more than this.
_ELBOW_M = 0.08
# A seat's rim may be round or worn for this much before its front edge.
_RIM_M = 0.1
# What is lower than this is floor.
_FLOOR_M = 0.06
# A backrest rises by this much within this distance behind the seated pelvis.
_BACK_RISE_M, _BACK_REACH_M = 0.15, 0.55
# From here a robot turns and steps back to a seat.
_APPROACH_M = (0.2, 1.0)
TARGET_M = 0.8
"""A target named by a place means a seat no farther away than this."""


def find_seats(half_width_m: float, floor: FreeFloor, sit_on: SitOn, collision_mjcf: Path) -> tuple[Seat, ...]:
    """Every seat that ``sit_on`` admits for a robot and that the free floor leads to.

    ``half_width_m`` is the standing robot's, to either side. A seat is a level surface of an
    admitted height, as wide as the hips, whose front falls to open floor; where a surface has
    backrests only places before one are taken, if any is open. Raises RobotError when there
    is none.
    """
    heights, origin = _height_map(floor, collision_mjcf)
    seats = _seats(heights - floor.floor_z_m, origin, half_width_m, floor, sit_on)
    if sit_on.target != ANY_SEAT and seats:
        away = np.array([np.linalg.norm(np.subtract(seat.edge_m, sit_on.target)) for seat in seats])
        wanted = seats[int(away.argmin())].surface if away.min() <= TARGET_M else -1
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


def one_a_surface(places: Sequence[Seat]) -> tuple[Seat, ...]:
    """One of the ``places`` on each surface: the one in the middle of all that the surface offers."""
    surfaces = sorted({seat.surface for seat in places})
    return tuple(_in_the_middle([seat for seat in places if seat.surface == surface]) for surface in surfaces)


def _in_the_middle(places: Sequence[Seat]) -> Seat:
    """The place with the least sum of distances to the others, the first of equal ones."""
    edges = np.array([seat.edge_m for seat in places])
    yaws = np.array([seat.yaw_rad for seat in places])
    turns = np.abs(np.angle(np.exp(1j * (yaws[:, None] - yaws))))
    apart = np.linalg.norm(edges[:, None] - edges, axis=2) + TURN_M * turns
    return places[int(apart.sum(axis=1).argmin())]


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


@dataclass(frozen=True)
class _Map:
    """Values on the grid of heights; -1 beyond it."""

    values: np.ndarray
    origin: np.ndarray

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """The values (...,) at world points (..., 2)."""
        index = np.rint((points - self.origin) / _CELL_M).astype(int)
        last = np.array(self.values.shape)[::-1] - 1
        inside = ((index >= 0) & (index <= last)).all(axis=-1)
        index = np.clip(index, 0, last)
        return np.where(inside, self.values[index[..., 1], index[..., 0]], -1.0)


def _seats(
    heights: np.ndarray, origin: np.ndarray, half_width_m: float, floor: FreeFloor, sit_on: SitOn
) -> tuple[Seat, ...]:
    """Seats on a map of heights above the floor: every place on a front edge, every heading."""
    low, high = sit_on.height_m
    known = np.nan_to_num(heights, nan=-1.0)
    rise = ndimage.maximum_filter(known, 3) - ndimage.minimum_filter(known, 3)
    surface, _ = ndimage.label((known >= low) & (known <= high) & (rise < _STEP_M))
    enough = np.bincount(surface.ravel()) * _CELL_M**2 >= _MIN_AREA_M2
    enough[0] = False
    rows, columns = np.nonzero(enough[surface])
    if not len(rows):
        return ()
    points = origin + _CELL_M * np.stack([columns, rows], axis=1)
    found = [
        pair
        for yaw in np.linspace(0.0, 2.0 * np.pi, _HEADINGS, endpoint=False)
        for pair in _facing(_Map(known, origin), _Map(surface, origin), points, yaw, half_width_m, floor)
    ]
    with_back = {seat.surface for seat, backed in found if backed}
    return tuple(seat for seat, backed in found if backed or seat.surface not in with_back)


def _facing(
    height: _Map, surface: _Map, points: np.ndarray, yaw: float, half_width_m: float, floor: FreeFloor
) -> Iterator[tuple[Seat, bool]]:
    """The seats among ``points`` (n, 2) that face along ``yaw``, and whether a backrest is behind."""
    ahead = np.array([np.cos(yaw), np.sin(yaw)])
    aside = np.array([-ahead[1], ahead[0]])

    def beside(forward_m: np.ndarray, half_m: float) -> np.ndarray:
        """Heights (n, forward, across) around ``points``; ``forward_m`` (f,) or (n, f)."""
        across_m = np.linspace(-half_m, half_m, 2 * round(half_m / _CELL_M) + 1)
        forward_m = np.broadcast_to(forward_m, (len(points), np.shape(forward_m)[-1]))
        place = points[:, None] + forward_m[..., None] * ahead
        return height(place[:, :, None] + across_m[:, None] * aside)

    # The foremost level cells alone; behind them the surface goes on under the hips.
    points = points[surface(points + _CELL_M * ahead) != surface(points)]
    hips_m, arms_m = _HIPS * half_width_m, _ARMS * half_width_m
    level_m = height(points)[:, None, None]
    under = beside(-np.arange(0.0, _DEPTH_M, _CELL_M), hips_m)
    around = beside(-np.arange(0.0, _TORSO_M, _CELL_M), arms_m)
    points = points[
        (np.abs(under - level_m) < 2.0 * _STEP_M).all(axis=(1, 2)) & (around < level_m + _ELBOW_M).all(axis=(1, 2))
    ]
    # Before them the rim, then floor as far as the robot steps back, with room for its arms.
    level_m = height(points)
    rim_m = np.arange(0.0, _RIM_M + 1e-9, _CELL_M)
    front = beside(rim_m + _CELL_M, hips_m).max(axis=2, initial=-1.0)
    is_floor = front < _FLOOR_M
    edge_m = rim_m[is_floor.argmax(axis=1)] + 0.5 * _CELL_M
    has_edge = is_floor.any(axis=1) & (front < level_m[:, None] + 2.0 * _STEP_M).all(axis=1)
    points, level_m, edge_m = points[has_edge], level_m[has_edge], edge_m[has_edge]
    steps_m = np.arange(_CELL_M, _APPROACH_M[1], _CELL_M)
    before = edge_m[:, None] + steps_m
    is_open = beside(before, arms_m).max(axis=2, initial=-1.0) < _FLOOR_M
    is_open = np.logical_and.accumulate(is_open, axis=1) & (steps_m >= _APPROACH_M[0])
    is_open &= floor.is_free(points[:, None] + before[..., None] * ahead)
    behind = beside(-np.arange(_DEPTH_M, _BACK_REACH_M, _CELL_M), 0.0).max(axis=(1, 2), initial=-1.0)
    for index in np.flatnonzero(is_open.any(axis=1)):
        edge = points[index] + edge_m[index] * ahead
        seat = Seat(
            edge_m=(float(edge[0]), float(edge[1])),
            height_m=float(level_m[index] + floor.floor_z_m),
            yaw_rad=float(yaw),
            approach_m=float(steps_m[is_open[index].argmax()]),
            surface=int(surface(points[index])),
        )
        yield seat, bool(behind[index] > level_m[index] + _BACK_RISE_M)

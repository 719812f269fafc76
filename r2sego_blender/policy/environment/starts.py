"""Where an episode begins and what is to be reached: drawn over the free floor, with a way from one to the other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from ...core.errors import RobotError
from ...robot.behaviours.trajectory import Seat
from ...robot.planning.course import draw
from ...robot.planning.free_floor import CELL_M, FreeFloor
from ...robot.planning.navigation import draw_cell, draw_path, path_between
from .chairs import CHAIRS, Chair
from .training_scene import TrainingScene

_TRIES = 2000  # a chair fits in few places of a small room
# Before a chair a robot turns and steps back, as before the room's own seats.
_APPROACH_M = np.arange(0.2, 1.0, 0.025)
# Who looks around near the target stands in front of it, and so far to the side and beyond.
_BEFORE_SEAT_M, _AROUND_M = (0.0, 1.0), 0.2
_CHAIR_SURFACE = -1
_HEADING_POINTS = 4  # of a path: whither it begins


@dataclass(frozen=True)
class PlacedChair:
    """The kind ``name`` at ``world_from_chair`` (4, 4), and the place to sit on it."""

    name: str
    world_from_chair: np.ndarray
    seat: Seat


@dataclass(frozen=True)
class Start:
    """The robot stands at ``place_m`` (2,), facing ``heading_rad``, on ``floor``, in which a ``chair`` may stand.

    It has to sit on ``seat``, or to get to ``goal_m`` (2,); the other is None.
    """

    place_m: np.ndarray
    heading_rad: float
    floor: FreeFloor
    seat: Seat | None = None
    goal_m: np.ndarray | None = None
    chair: PlacedChair | None = None

    def at(self, place_m: np.ndarray, heading_rad: float) -> Start:
        """The same from another place (2,)."""
        return replace(self, place_m=place_m, heading_rad=heading_rad)

    def looking_around(self, near_target: bool, rng: np.random.Generator) -> Start:
        """The same with any heading, and where ``near_target``, from around the seat or the goal."""
        heading, offset = rng.uniform(-math.pi, math.pi), rng.normal(0.0, _AROUND_M, 2)
        along_m = rng.uniform(*_BEFORE_SEAT_M)
        place = self.place_m
        if near_target and self.seat is not None:
            place = self.seat.ahead(along_m) + offset
        elif near_target and self.goal_m is not None:
            place = self.goal_m + offset
        return self.at(place, heading)


def draw_start(scene: TrainingScene, sits: bool, chairs: Sequence[str], rng: np.random.Generator) -> Start:
    """A start of the task, with a chair of one of the kinds ``chairs`` if there are any: to sit on it where
    ``sits``, else to walk around it. Raises RobotError where the room has no place for it."""
    for _ in range(_TRIES):
        chair, floor = None, scene.floor
        if chairs:
            chair = _draw_chair(scene, chairs[int(rng.integers(len(chairs)))], rng)
            if chair is None:
                continue
            floor = floor_around(scene, chair)
        start = _draw_sit(scene, floor, chair, rng) if sits else _draw_walk(scene, floor, chair, rng)
        if start is not None:
            return start
    raise RobotError(
        "no start with a way to its target was found",
        where=scene.collision_mjcf,
        cure="Check the free floor, give the scope a smaller region.clearance_m, or leave the chairs away.",
    )


def _draw_sit(
    scene: TrainingScene, floor: FreeFloor, chair: PlacedChair | None, rng: np.random.Generator
) -> Start | None:
    row, column = draw_cell(floor.free, rng)
    if chair is None:
        nearest = int(scene.ways[0][row, column])
        if nearest < 0:
            return None
        seat = scene.seats[nearest]
    else:
        seat = chair.seat
    goal_row, goal_column = floor.cells(seat.ahead(seat.approach_m))
    path = path_between(floor, (row, column), (int(goal_row), int(goal_column)))
    return None if path is None else _started(scene, floor, path, rng, seat=seat, chair=chair)


def _draw_walk(
    scene: TrainingScene, floor: FreeFloor, chair: PlacedChair | None, rng: np.random.Generator
) -> Start | None:
    speed_m_s = scene.scope.walk_to.speed_m_s[1]
    path = draw_path(floor, draw_cell(floor.free, rng), scene.scope, speed_m_s, rng)
    return None if path is None else _started(scene, floor, path, rng, goal_m=path[-1], chair=chair)


def _started(
    scene: TrainingScene,
    floor: FreeFloor,
    path: np.ndarray,
    rng: np.random.Generator,
    seat: Seat | None = None,
    goal_m: np.ndarray | None = None,
    chair: PlacedChair | None = None,
) -> Start:
    """At the path's beginning, facing along it within the scope's range; any way where it is no path."""
    heading = rng.uniform(-math.pi, math.pi)
    if len(path) > 1:
        ahead = path[min(len(path) - 1, _HEADING_POINTS)] - path[0]
        heading = math.atan2(ahead[1], ahead[0]) + math.radians(draw(scene.scope.start.heading_offset_deg, rng))
    return Start(path[0].copy(), heading, floor, seat, goal_m, chair)


def _draw_chair(scene: TrainingScene, name: str, rng: np.random.Generator) -> PlacedChair | None:
    """The chair somewhere on the free floor with free floor before it; None where it does not fit this time."""
    chair, floor = CHAIRS[name], scene.floor
    row, column = draw_cell(floor.free, rng)
    yaw = rng.uniform(-math.pi, math.pi)
    ahead = np.array([math.cos(yaw), math.sin(yaw)])
    edge = floor.points(np.array(row), np.array(column)) + chair.depth_m / 2.0 * ahead
    pose = np.eye(4)
    pose[:2, 0], pose[:2, 1] = ahead, (-ahead[1], ahead[0])
    pose[:3, 3] = (*edge, floor.floor_z_m)
    if not floor.is_free(_outline(chair, pose)).all():
        return None
    seat = Seat((float(edge[0]), float(edge[1])), floor.floor_z_m + chair.height_m, yaw, 0.0, _CHAIR_SURFACE)
    free = floor_around(scene, PlacedChair(name, pose, seat)).is_free(
        np.array([seat.ahead(float(away)) for away in _APPROACH_M])
    )
    if not free.any():
        return None
    return PlacedChair(name, pose, replace(seat, approach_m=float(_APPROACH_M[int(free.argmax())])))


def _outline(chair: Chair, pose: np.ndarray) -> np.ndarray:
    """Corners (4, 2) of the chair on the floor."""
    half = chair.width_m / 2.0
    corners = np.array([(0.0, -half), (0.0, half), (-chair.depth_m, half), (-chair.depth_m, -half)])
    return corners @ pose[:2, :2].T + pose[:2, 3]


def floor_around(scene: TrainingScene, placed: PlacedChair) -> FreeFloor:
    """The scene's free floor without what is nearer to the chair than the robot reaches: its largest piece."""
    floor, chair = scene.floor, CHAIRS[placed.name]
    rows, columns = np.indices(floor.free.shape)
    local = (floor.points(rows, columns) - placed.world_from_chair[:2, 3]) @ placed.world_from_chair[:2, :2]
    beyond_x = np.maximum(np.maximum(local[..., 0], -chair.depth_m - local[..., 0]), 0.0)
    beyond_y = np.maximum(np.abs(local[..., 1]) - chair.width_m / 2.0, 0.0)
    reach_m = scene.robot.radius_m + scene.scope.region.clearance_m
    pieces, _ = ndimage.label(floor.free & (np.hypot(beyond_x, beyond_y) > reach_m))
    sizes = np.bincount(pieces.ravel(), minlength=2)[1:]
    free = (pieces == 1 + int(sizes.argmax())) & (pieces > 0)
    clearance_m = ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1] * CELL_M
    return replace(floor, free=free, clearance_m=clearance_m)

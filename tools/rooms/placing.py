"""Where cameras stand: captures around a room that hardly overlap, frozen views of a robot's head."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from math import cos, radians, sin

import numpy as np

from demo.living_room.cameras import upright
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import EvaluationError
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer

from .free_floor import FreeFloor
from .seen import overlap_share

AROUND = 6
MOST_OVERLAP = 0.15
"""Of the pixels of captures that hardly overlap: the share that another capture sees too."""

_EYE_M, _DOWN_DEG = 1.52, 15.0
_CAPTURE_CLEARANCE_M = 0.25
_ROBOT_CLEARANCE_M = 0.30
_TRIED_SIDE_PX = 96
_SEEN_CELL_M = 0.1
_LEAST_FLOOR = 0.03
_LEAST_MEDIAN_M = 1.3


def captures_around(room: MeshRasterizer, floor: FreeFloor, lens: Camera, count: int = AROUND) -> list[Camera]:
    """Cameras at eye height at equal angles around a room's free middle, looking outwards.

    Of all loops, first angles and turns of the head tried whose captures see no more than MOST_OVERLAP twice,
    the one with most captures that show the room, and of these the one that sees most of it. Raises
    EvaluationError where there is none.
    """
    small = lens.fitted(_TRIED_SIDE_PX)
    best, best_worth = None, (-1, -1)
    for stops in _loops(floor, count):
        cameras = [small.at(upright(*stop)) for stop in stops]
        depths = [room.render(camera).depth for camera in cameras]
        good = sum(map(_shows_a_room, cameras, depths))
        if good < best_worth[0] or overlap_share(cameras, depths) > 0.9 * MOST_OVERLAP:
            continue
        points = np.concatenate([c.unproject(d)[d > 0.0] for c, d in zip(cameras, depths, strict=True)])
        worth = good, len(np.unique(np.floor(points / _SEEN_CELL_M).astype(int), axis=0))
        if worth > best_worth:
            best, best_worth = stops, worth
    if best is None:
        raise EvaluationError(
            f"no {count} captures around the room overlap less than {MOST_OVERLAP:.0%}",
            cure="Give a larger room, or a longer lens.",
        )
    return [lens.at(upright(*stop)) for stop in best]


def _shows_a_room(camera: Camera, depth: np.ndarray) -> bool:
    """Whether it is of the room: some floor, and neither a wall at arm's length nor mostly a window."""
    points = camera.unproject(depth)[depth > 0.0]
    if len(points) < 0.7 * depth.size:
        return False
    floor = np.mean(np.abs(points[:, 2]) < 0.05)
    return bool(floor > _LEAST_FLOOR and np.median(depth) > _LEAST_MEDIAN_M)


def _loops(floor: FreeFloor, count: int) -> list[list[tuple[float, ...]]]:
    """Stops (x, y, z, heading, degrees down) of each loop around the room to try."""
    places = floor.places(_CAPTURE_CLEARANCE_M)
    middles = [middle_of(places, floor, share) for share in (0.5, 4.0)]
    loops = []
    heights = _EYE_M + 0.03 * np.array([0, 1, -1, 2, -2, 1])[np.arange(count) % 6]
    for middle, reach, share in itertools.product(middles, (0.3, 0.5, 0.7, 0.9), range(6)):
        angles = 360.0 / count * (share / 6.0 + np.arange(count))
        at = np.array([_towards(floor, middle, angle, reach) for angle in angles])
        for turn_deg in (-90.0, -60.0, -40.0, -20.0, 0.0, 20.0, 40.0, 60.0, 90.0):
            stops = zip(at[:, 0], at[:, 1], heights, angles + turn_deg, [_DOWN_DEG] * count, strict=True)
            loops.append([tuple(map(float, stop)) for stop in stops])
    return loops


def middle_of(places: np.ndarray, floor: FreeFloor, near_mean: float) -> np.ndarray:
    """(2,): where clearance less ``near_mean`` times the distance from the mean of ``places`` (P, 2) is largest."""
    middle: np.ndarray = places[
        np.argmax(floor.at(places) - near_mean * np.linalg.norm(places - places.mean(axis=0), axis=1))
    ]
    return middle


def reach_m(floor: FreeFloor, middle: np.ndarray, angle_deg: float) -> float:
    """How far one may go from the middle (2,) in a direction, metres."""
    direction = np.array([cos(radians(angle_deg)), sin(radians(angle_deg))])
    ahead = np.arange(0.0, 20.0, 0.02)
    blocked = floor.at(middle + ahead[:, None] * direction) < _CAPTURE_CLEARANCE_M
    return float(ahead[np.argmax(blocked)])


def _towards(floor: FreeFloor, middle: np.ndarray, angle_deg: float, reach: float) -> np.ndarray:
    """(2,): a share of the way there."""
    direction = np.array([cos(radians(angle_deg)), sin(radians(angle_deg))])
    towards: np.ndarray = middle + direction * reach_m(floor, middle, angle_deg) * reach
    return towards


def farthest_views(
    room: MeshRasterizer, floor: FreeFloor, captures: Sequence[Camera], count: int, seed: int
) -> list[Camera]:
    """Views of a robot's head, each as far as can be from all captures and from those before it.

    Heights 1.20 to 1.28 m, 22 to 45 degrees down, headings drawn from those that look farther than 1 m.
    """
    rng = np.random.default_rng(seed)
    lens = captures[0]
    small = lens.fitted(_TRIED_SIDE_PX)
    places = floor.places(_ROBOT_CLEARANCE_M)
    away = np.min([np.linalg.norm(places - capture.centre[:2], axis=1) for capture in captures], axis=0)
    views = []
    for _ in range(count):
        x, y = places[np.argmax(away)]
        away = np.minimum(away, np.hypot(places[:, 0] - x, places[:, 1] - y))
        z, down = rng.uniform(1.20, 1.28), rng.uniform(22.0, 45.0)
        headings = rng.permutation(12) * 30.0 + rng.uniform(0.0, 30.0)
        poses = [upright(x, y, z, heading, down) for heading in headings]
        depths = [room.render(small.at(pose)).depth for pose in poses]
        far = [float(np.median(depth)) if depth.all() else 0.0 for depth in depths]
        views.append(lens.at(poses[next((i for i, m in enumerate(far) if m > 1.0), int(np.argmax(far)))]))
    return views

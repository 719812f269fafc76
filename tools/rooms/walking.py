"""A walk through a room: captures at equal intervals of it, in nested sets, and a robot's routine route."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees

import numpy as np
from scipy import ndimage

from demo.living_room.cameras import upright
from r2sego_blender.core.cameras import Camera

from .free_floor import FreeFloor
from .placing import middle_of, reach_m

NESTED = (6, 10, 15, 30, 45)
"""Captures of the sets of one walk."""

_STEP_DEG = 2.0
_ROBOT_HEAD_M, _ROBOT_DOWN_DEG = (1.20, 1.28), (22.0, 45.0)


def nested_sets(count: int = NESTED[-1], sizes: Sequence[int] = NESTED) -> dict[int, list[int]]:
    """Size -> the indices of its captures of ``count`` on a walk, each set within the next larger one.

    Intervals are as equal as that allows. The largest of ``sizes`` may be ``count`` at most.
    """
    chosen = list(range(count))
    found = {}
    for size in sorted(sizes, reverse=True):
        chosen = [chosen[round(place)] for place in np.linspace(0.0, len(chosen) - 1, size)]
        found[size] = chosen
    return dict(sorted(found.items()))


def loop_around(floor: FreeFloor, reach: float) -> np.ndarray:
    """(180, 2) metres: a closed way around the room's free middle, ``reach`` of the way to what stands there.

    ``reach`` is a share below 1.
    """
    places = floor.places(0.25)
    middle = middle_of(places, floor, 0.5)
    angles = np.arange(0.0, 360.0, _STEP_DEG)
    radius = np.array([reach_m(floor, middle, angle) for angle in angles])
    # The mean of the least around stays below what is free at each angle.
    radius = ndimage.minimum_filter1d(radius, 11, mode="wrap")
    radius = ndimage.uniform_filter1d(radius, 9, mode="wrap") * reach
    turn = np.radians(angles)
    around: np.ndarray = middle + radius[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return around


def along(path: np.ndarray, count: int, closed: bool) -> tuple[np.ndarray, np.ndarray]:
    """(count, 2) places at equal intervals of a path (N, 2), and (count,) degrees of the direction of travel there."""
    if closed:
        path = np.concatenate([path, path[:1]])
    passed = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    at = np.linspace(0.0, passed[-1], count, endpoint=not closed)
    places = np.stack([np.interp(at, passed, path[:, axis]) for axis in range(2)], axis=1)
    ahead = np.stack([np.interp(at + 0.05, passed, path[:, axis]) for axis in range(2)], axis=1)
    behind = np.stack([np.interp(at - 0.05, passed, path[:, axis]) for axis in range(2)], axis=1)
    way = ahead - behind
    return places, np.degrees(np.arctan2(way[:, 1], way[:, 0]))


def walk_captures(
    floor: FreeFloor, lens: Camera, count: int, eye_m: float, share: float, look_deg: float, seed: int
) -> list[Camera]:
    """Captures of somebody who walks a ``share`` of the way around a room, counter-clockwise.

    They look ``look_deg`` to the left of where they go: 90 is to the middle. Hands and steps sway a little.
    """
    rng = np.random.default_rng([seed, 2])
    path = loop_around(floor, 0.8)
    path = np.roll(path, -int(rng.integers(len(path))), axis=0)
    path = path[: max(2, round(share * len(path)))]
    places, travel = along(path, count, closed=share >= 1.0)
    sway = np.sin(np.arange(count) * 1.7 + rng.uniform(0.0, 6.0))
    return [
        lens.at(upright(x, y, eye_m + 0.015 * s, heading + look_deg + 5.0 * s, 14.0 + 3.0 * s))
        for (x, y), heading, s in zip(places, travel, sway, strict=True)
    ]


def routine_views(floor: FreeFloor, lens: Camera, count: int, seed: int) -> list[Camera]:
    """Views of a robot's head at equal intervals of a round through the room, near to where it goes."""
    rng = np.random.default_rng([seed, 3])
    path = loop_around(floor, 0.55)
    places, travel = along(np.roll(path, -int(rng.integers(len(path))), axis=0), count, closed=True)
    turn, down, height = (
        rng.uniform(-25.0, 60.0, count),
        rng.uniform(*_ROBOT_DOWN_DEG, count),
        rng.uniform(*_ROBOT_HEAD_M, count),
    )
    return [
        lens.at(upright(x, y, z, heading + t, d))
        for (x, y), heading, t, d, z in zip(places, travel, turn, down, height, strict=True)
    ]


def apart(one: Camera, other: Camera) -> tuple[float, float]:
    """Metres between two cameras, and degrees between where they look."""
    cosine = float(np.clip(one.forward @ other.forward, -1.0, 1.0))
    return float(np.linalg.norm(one.centre - other.centre)), degrees(np.arccos(cosine))

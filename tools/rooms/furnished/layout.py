"""The shell of a room on paper: a rectangle or an L, its walls, doors and windows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .style import Style

DOOR_M = (0.9, 2.05)
"""Width and height."""

_APART_M = 0.35  # between openings, and from corners


@dataclass(frozen=True)
class Opening:
    """A door or window: its middle ``along_m`` from the wall's first corner; ``sill_m`` 0 for a door."""

    kind: str
    along_m: float
    width_m: float
    sill_m: float
    head_m: float


@dataclass(frozen=True)
class Wall:
    """From corner to corner (2,), the room on its left; ``convex`` tells of both corners whether they are."""

    start: np.ndarray
    end: np.ndarray
    convex: tuple[bool, bool]
    openings: tuple[Opening, ...] = ()

    @property
    def length_m(self) -> float:
        return float(np.linalg.norm(self.end - self.start))

    @property
    def along(self) -> np.ndarray:
        """(2,) unit."""
        along: np.ndarray = (self.end - self.start) / self.length_m
        return along

    @property
    def inwards(self) -> np.ndarray:
        """(2,) unit, into the room."""
        along = self.along
        return np.array([-along[1], along[0]])

    def free_of(self, first_m: float, last_m: float, kinds: tuple[str, ...]) -> bool:
        """Whether no opening of these kinds lies between two places along the wall."""
        return not any(
            one.kind in kinds and first_m < one.along_m + one.width_m / 2 and last_m > one.along_m - one.width_m / 2
            for one in self.openings
        )


@dataclass(frozen=True)
class Layout:
    """``half`` (2,) half the width and depth around the origin; ``notch`` (2, 2) the corners of what an L lacks."""

    half: np.ndarray
    notch: np.ndarray | None
    height_m: float
    walls: tuple[Wall, ...]

    def corners(self) -> np.ndarray:
        """(4 or 6, 2): the floor's outline, counter-clockwise."""
        return np.array([wall.start for wall in self.walls])

    def contains(self, points: np.ndarray) -> np.ndarray:
        """(...,) bool of points (..., 2)."""
        inside: np.ndarray = (np.abs(points) <= self.half).all(axis=-1)
        if self.notch is not None:
            inside &= ~((points > self.notch[0]) & (points < self.notch[1])).all(axis=-1)
        return inside


def draw_layout(style: Style, rng: np.random.Generator) -> Layout:
    """A layout of a style: one door, and as many windows as find their place."""
    half = np.round([rng.uniform(*style.width_m) / 2, rng.uniform(*style.depth_m) / 2], 3)
    notch = None
    if rng.random() < style.l_shaped:
        size = 2 * half * rng.uniform(0.28, 0.42, 2)
        side = rng.choice([-1.0, 1.0], 2)
        corners = np.stack([side * half, side * (half - size)])
        notch = np.round(np.stack([corners.min(axis=0), corners.max(axis=0)]), 3)
    height = round(float(rng.uniform(*style.height_m)), 3)
    outline = _outline(half, notch)
    walls = [Wall(start, end, convex) for start, end, convex in _edges(outline)]
    wanted = ["door"] + ["window"] * int(rng.integers(style.windows[0], style.windows[1] + 1))
    for kind in wanted:
        _open(walls, kind, height, rng)
    return Layout(half, notch, height, tuple(walls))


def _outline(half: np.ndarray, notch: np.ndarray | None) -> np.ndarray:
    corners = [half * sign for sign in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    if notch is None:
        return np.array(corners)
    found = []
    for index, corner in enumerate(corners):
        if not ((corner >= notch[0]) & (corner <= notch[1])).all():
            found.append(corner)
            continue
        inner = np.where(corner == notch[0], notch[1], notch[0])
        by_x, by_y = np.array([inner[0], corner[1]]), np.array([corner[0], inner[1]])
        # The walls before corners 1 and 3 run along x.
        found += [by_x, inner, by_y] if index % 2 else [by_y, inner, by_x]
    return np.array(found)


def _edges(outline: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, tuple[bool, bool]]]:
    before, after = np.roll(outline, 1, axis=0), np.roll(outline, -1, axis=0)
    into, out = outline - before, after - outline
    convex = into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0] > 0.0
    for index in range(len(outline)):
        following = (index + 1) % len(outline)
        yield outline[index], outline[following], (bool(convex[index]), bool(convex[following]))


def _open(walls: list[Wall], kind: str, height_m: float, rng: np.random.Generator) -> None:
    """One door or window in one of the walls, if one has room for it."""
    for index in rng.permutation(len(walls)):
        wall = walls[index]
        if kind == "door":
            width, sill, head = DOOR_M[0], 0.0, DOOR_M[1]
        else:
            width = float(rng.uniform(0.9, max(0.95, min(2.2, wall.length_m - 1.2))))
            sill, head = float(rng.uniform(0.6, 1.0)), min(height_m - 0.25, 2.2)
        low, high = width / 2 + _APART_M, wall.length_m - width / 2 - _APART_M
        if low >= high:
            continue
        along = float(rng.uniform(low, high))
        if not wall.free_of(along - width / 2 - _APART_M, along + width / 2 + _APART_M, ("door", "window")):
            continue
        opened = (*wall.openings, Opening(kind, along, width, sill, head))
        walls[index] = Wall(wall.start, wall.end, wall.convex, tuple(sorted(opened, key=lambda one: one.along_m)))
        return

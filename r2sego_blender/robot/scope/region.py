"""The polygon of a behaviour region on the floor: as text, and what is wrong with one. No NumPy needed."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...core.errors import RobotError
from ...core.formatting import told_apart

Polygon = tuple[tuple[float, float], ...]
"""Corners (x, y) in metres, in the world, in order around the region."""

_SMALLEST_M2, _LARGEST_M2 = 0.05, 1000.0
_MOST_CORNERS = 500


def parse_polygon(text: str) -> Polygon:
    """The corners of a text such as ``0,0 2,0 2,1.5``. Raises RobotError when it is none."""
    try:
        corners = tuple((float(x), float(y)) for x, y in (pair.split(",") for pair in text.split()))
    except ValueError as error:
        raise RobotError(
            f"'{text[:80]}' is no polygon",
            where="region.within",
            cure="Write corners in metres as x,y with spaces between: 0,0 2,0 2,1.5.",
        ) from error
    if problem := problem_of(corners):
        raise RobotError(f"the polygon {problem}", where="region.within", cure="Draw another.")
    return corners


def format_polygon(corners: Sequence[Sequence[float]]) -> str:
    """The text that ``parse_polygon`` reads, to a tenth of a millimetre."""
    return " ".join(f"{x:.4f},{y:.4f}" for x, y in corners)


def area_m2(corners: Sequence[Sequence[float]]) -> float:
    """The area within the corners; positive where they go counter-clockwise."""
    following = [*corners[1:], *corners[:1]]
    return 0.5 * sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(corners, following, strict=True))


def problem_of(corners: Sequence[Sequence[float]]) -> str:
    """Why these corners bound no region, in words that follow "the polygon"; '' where they do."""
    if not 3 <= len(corners) <= _MOST_CORNERS:
        return f"has {len(corners)} corners, not 3 to {_MOST_CORNERS}"
    if not all(math.isfinite(value) for corner in corners for value in corner):
        return "has corners that are not finite"
    crossing = _first_crossing(corners)
    if crossing is not None:
        return "crosses itself: sides {} and {}".format(*(1 + side for side in crossing))
    area = abs(area_m2(corners))
    if not _SMALLEST_M2 <= area <= _LARGEST_M2:
        told = told_apart(area, _SMALLEST_M2 if area < _SMALLEST_M2 else _LARGEST_M2, 3, "g")
        return f"has {told} square metres, not {_SMALLEST_M2:g} to {_LARGEST_M2:g}"
    return ""


def _first_crossing(corners: Sequence[Sequence[float]]) -> tuple[int, int] | None:
    """The first two sides that cross one another properly; neighbours share a corner alone."""
    sides = list(zip(corners, [*corners[1:], *corners[:1]], strict=True))
    for first in range(len(sides)):
        for second in range(first + 2, len(sides)):
            if not (first == 0 and second == len(sides) - 1) and _cross(*sides[first], *sides[second]):
                return first, second
    return None


def _cross(a: Sequence[float], b: Sequence[float], c: Sequence[float], d: Sequence[float]) -> bool:
    return _side(a, b, c) * _side(a, b, d) < 0.0 and _side(c, d, a) * _side(c, d, b) < 0.0


def _side(a: Sequence[float], b: Sequence[float], point: Sequence[float]) -> float:
    """Positive where ``point`` lies to the left of the way from a to b."""
    return (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0])

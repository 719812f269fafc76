"""Fewer convex pieces of many, for simulators whose time goes with their number."""

from __future__ import annotations

import heapq
from collections.abc import Sequence

import numpy as np
from scipy.spatial import ConvexHull

from .convex import Piece, convex_hull

_NEAR_M = 0.02


def merged(pieces: Sequence[Piece], most: int) -> list[Piece]:
    """At most ``most`` convex pieces that hold all of ``pieces``; more where too few of those are near each other.

    Two near ones become their hull, always those whose hull adds the least volume. Deterministic.
    """
    points = {index: np.asarray(vertices, np.float64) for index, (vertices, _) in enumerate(pieces)}
    volumes = {index: float(ConvexHull(one).volume) for index, one in points.items()}
    near = _near(list(points.values()))
    waiting = [(_added(points, volumes, i, j), i, j) for i, others in near.items() for j in others if i < j]
    heapq.heapify(waiting)
    while len(points) > most and waiting:
        _, i, j = heapq.heappop(waiting)
        if i not in points or j not in points:
            continue
        new = max(points) + 1
        vertices, _ = convex_hull(np.concatenate([points.pop(i), points.pop(j)]))
        others = (near.pop(i) | near.pop(j)) - {i, j}
        points[new], volumes[new], near[new] = vertices, float(ConvexHull(vertices).volume), others
        for other in others:
            near[other] = (near[other] - {i, j}) | {new}
            heapq.heappush(waiting, (_added(points, volumes, other, new), other, new))
    return [convex_hull(one) for one in points.values()]


def _added(points: dict[int, np.ndarray], volumes: dict[int, float], i: int, j: int) -> float:
    """The volume, cubic metres, that the hull of two has beyond theirs."""
    return float(ConvexHull(np.concatenate([points[i], points[j]])).volume) - volumes[i] - volumes[j]


def _near(points: Sequence[np.ndarray]) -> dict[int, set[int]]:
    """For each piece the others whose box comes within ``_NEAR_M`` of its own."""
    lows, highs = np.array([one.min(axis=0) for one in points]), np.array([one.max(axis=0) for one in points])
    found = {}
    for index in range(len(points)):
        apart = np.maximum(lows - highs[index], lows[index] - highs).max(axis=1)
        found[index] = set(map(int, np.flatnonzero(apart < _NEAR_M))) - {index}
    return found

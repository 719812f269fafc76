"""Questions to triangles (T, 3, 3) in space: how far, what lies above, what a path crosses.

Triangles are counter-clockwise seen from the side they face. Each question is cut down by
bounding boxes first, so that thousands of points meet a million triangles in seconds.
"""

from __future__ import annotations

import numpy as np
import trimesh

from .boxes import Boxes, touched

_SEGMENTS = 16  # of a path that are asked together


def distances(triangles: np.ndarray, points: np.ndarray, reach: float) -> np.ndarray:
    """(N,) distance from points (N, 3) to the nearest triangle, inf where beyond ``reach``.

    Points that are not finite are beyond it.
    """
    boxes = Boxes(triangles.min(1), triangles.max(1))
    found = np.full(len(points), np.inf)
    for index in np.flatnonzero(np.isfinite(points).all(1)):
        point = points[index]
        near = triangles[boxes.meeting(point - reach, point + reach)]
        if len(near):
            closest = trimesh.triangles.closest_point(near, np.tile(point, (len(near), 1)))
            nearest = float(np.linalg.norm(closest - point, axis=1).min())
            found[index] = nearest if nearest <= reach else np.inf
    return found


def columns(triangles: np.ndarray, places: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """What stands on the vertical line through each place (N, 2).

    For each: heights (k,), ascending, and (k,) bool, which of them face up. Upright triangles
    are not met; a line through an edge meets both its triangles.
    """
    a, b, c = np.moveaxis(triangles, 1, 0)
    normal = np.cross(b - a, c - a)
    level = np.abs(normal[:, 2]) > 1e-12
    triangles, normal = triangles[level], normal[level]
    boxes = Boxes(triangles[:, :, :2].min(1), triangles[:, :, :2].max(1))
    met = []
    for place in places:
        near = boxes.meeting(place, place)
        corners, up = triangles[near], np.sign(normal[near, 2])
        inside = np.ones(len(near), bool)
        for first, second in ((0, 1), (1, 2), (2, 0)):
            edge = corners[:, second, :2] - corners[:, first, :2]
            away = place - corners[:, first, :2]
            inside &= up * (edge[:, 0] * away[:, 1] - edge[:, 1] * away[:, 0]) >= 0.0
        near, corners = near[inside], corners[inside]
        slope = ((place - corners[:, 0, :2]) * normal[near, :2]).sum(1) / normal[near, 2]
        heights = corners[:, 0, 2] - slope
        order = np.argsort(heights, kind="stable")
        met.append((heights[order], normal[near, 2][order] > 0.0))
    return met


def crossed(triangles: np.ndarray, paths: np.ndarray) -> np.ndarray:
    """(N,) whether paths (N, P, 3), chains of segments, go through a triangle from its front.

    A path ends before its first point that is not finite.
    """
    boxes = Boxes(triangles.min(1), triangles.max(1))
    found = np.zeros(len(paths), bool)
    for index, path in enumerate(paths):
        path = path[: np.argmin(np.append(np.isfinite(path).all(1), False))]
        if len(path) < 2:
            continue
        met = boxes.meeting(path.min(0), path.max(0))
        for first in range(0, len(path) - 1, _SEGMENTS):
            part = path[first : first + _SEGMENTS + 1]
            near = met[touched(boxes.low[met], boxes.high[met], part.min(0), part.max(0))]
            found[index] |= len(near) > 0 and _crossed(triangles[near], part[:-1], np.diff(part, axis=0))
    return found


def _crossed(triangles: np.ndarray, starts: np.ndarray, steps: np.ndarray) -> bool:
    """Moeller and Trumbore's test of all segments (S, 3) with all triangles."""
    a, b, c = (corner[None] for corner in np.moveaxis(triangles, 1, 0))
    starts, steps = starts[:, None], steps[:, None]
    across = np.cross(steps, c - a)
    determinant = ((b - a) * across).sum(-1)  # positive: from the front
    with np.errstate(divide="ignore", invalid="ignore"):
        away = starts - a
        u = (away * across).sum(-1) / determinant
        sideways = np.cross(away, b - a)
        v = (steps * sideways).sum(-1) / determinant
        t = ((c - a) * sideways).sum(-1) / determinant
        hit = (determinant > 0.0) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t >= 0.0) & (t < 1.0)
    return bool(hit.any())

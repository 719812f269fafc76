"""Planes through sparse points that no other plane of the room explains: fronts and tops of furniture.

Where photographs are blurred or share little, stereo sees nothing, yet a few points of a counter are
triangulated. Two of them tell an upright plane and one a level plane, as gravity is known.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...captures.sparse_points import SparsePoints
from ...core.cameras import Camera
from .planes import RoomPlanes

_MOST = 10
_FEWEST_POINTS = 12
_HYPOTHESES = 1024  # upright ones, and as many level ones, for each plane
_APART_M = (0.1, 3.0)  # two points that tell an upright plane
_TOLERANCE = 0.02  # of the distance from which a point was measured
_LEAST_TOLERANCE_M = 0.01
_MOST_ERROR_PX = 1.0
_LEAST_SINE = 0.03  # of the angle under which a point was triangulated
_REFINEMENTS = 3


def with_sparse_planes(planes: RoomPlanes, sparse: SparsePoints, cameras: Sequence[Camera]) -> RoomPlanes:
    """``planes`` and up to ten more, level or upright, by sequential RANSAC on the surely measured points that lie
    on none of them; they bound nothing. ``cameras`` are those that measured the points. Deterministic."""
    sine = sparse.widest_sine([camera.centre for camera in cameras])
    centres = np.array([camera.centre for camera in cameras])
    sure = (sparse.error_px < _MOST_ERROR_PX) & (sine > _LEAST_SINE)
    points, seen = sparse.points[sure], sparse.visibility[sure].astype(np.float64)
    views = seen.sum(axis=1)
    points, seen, views = points[views > 0], seen[views > 0], views[views > 0]
    towards = seen @ centres / views[:, None] - points
    away = np.linalg.norm(points[:, None] - centres[None], axis=2)
    tolerance = np.maximum(
        _TOLERANCE * np.where(seen > 0, away, np.inf).min(axis=1, initial=np.inf), _LEAST_TOLERANCE_M
    )
    left = ~_on(planes.normals, planes.offsets, points, towards, tolerance).any(axis=1)
    rng = np.random.default_rng(0)  # the same planes for the same points
    found: list[tuple[np.ndarray, float, int]] = []
    while len(found) < _MOST and left.sum() >= _FEWEST_POINTS:
        chosen = points[left], towards[left], tolerance[left]
        normal, offset = _best_hypothesis(*chosen, rng)
        for _ in range(_REFINEMENTS):
            on = _on(normal[None], np.array([offset]), *chosen)[:, 0]
            if on.sum() < _FEWEST_POINTS:
                break
            normal, offset = _fitted(chosen[0][on], 1.0 / chosen[2][on] ** 2, normal)
        on = _on(normal[None], np.array([offset]), *chosen)[:, 0]
        if on.sum() < _FEWEST_POINTS:
            break
        found.append((normal, offset, int(on.sum())))
        left[np.flatnonzero(left)[on]] = False
    if not found:
        return planes
    normals, offsets, inliers = (np.array(each) for each in zip(*found, strict=True))
    return planes.with_more(normals, offsets, inliers, bounding=False)


def _on(
    normals: np.ndarray, offsets: np.ndarray, points: np.ndarray, towards: np.ndarray, tolerance: np.ndarray
) -> np.ndarray:
    """(n, P) bool: the points (n, 3) that lie on each plane and are seen from its free side."""
    near = np.abs(points @ normals.T - offsets) < tolerance[:, None]
    return near & (towards @ normals.T > 0.0)


def _best_hypothesis(
    points: np.ndarray, towards: np.ndarray, tolerance: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, float]:
    one, other = rng.integers(0, len(points), (2, _HYPOTHESES))
    along = points[other] - points[one]
    length = np.hypot(along[:, 0], along[:, 1])
    told = (length > _APART_M[0]) & (length < _APART_M[1])
    upright = np.stack([-along[:, 1], along[:, 0], np.zeros(len(along))], axis=1)[told] / length[told, None]
    level = np.zeros((_HYPOTHESES, 3))
    level[:, 2] = 1.0
    normals = np.concatenate([upright, level])
    through = np.concatenate([one[told], rng.integers(0, len(points), _HYPOTHESES)])
    normals *= np.where(np.einsum("ij,ij->i", normals, towards[through]) < 0.0, -1.0, 1.0)[:, None]
    offsets = np.einsum("ij,ij->i", normals, points[through])
    best = int(np.argmax(_on(normals, offsets, points, towards, tolerance).sum(axis=0)))
    return normals[best], float(offsets[best])


def _fitted(points: np.ndarray, weights: np.ndarray, towards: np.ndarray) -> tuple[np.ndarray, float]:
    """The weighted least-squares plane, level or upright as ``towards`` is and on its side."""
    centre = np.average(points, axis=0, weights=weights)
    if towards[2] != 0.0:
        return towards, float(towards @ centre)
    apart = (points[:, :2] - centre[:2]) * np.sqrt(weights)[:, None]
    normal = np.append(np.linalg.eigh(apart.T @ apart)[1][:, 0], 0.0)
    normal *= np.sign(normal @ towards) or 1.0
    return normal, float(normal @ centre)

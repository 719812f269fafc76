"""How far geometry is from the truth: depth maps, and surfaces.

Scores alone are made of it: no step of a refinement may read the truth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from ...core.errors import EvaluationError
from .figures import RIGHT_DEPTH, SURFACE_TOLERANCE_M

FOUND_SAMPLES, TRUE_SAMPLES, VISIBLE_SPACING_M = 200_000, 600_000, 0.02
"""Points drawn on a surface that is scored and on the true one, and how far apart are those that captures truly see."""

_NEAREST_SAMPLES = 8  # whose faces are looked at exactly
_CHUNK = 20_000  # points whose exact distances are computed at a time


def within(found: Sequence[np.ndarray], true: Sequence[np.ndarray], tolerance: float) -> float:
    """The share of the pixels with a true depth whose depth lies within ``tolerance`` of it, relative.

    Maps (H, W) in metres, one size a pair, 0 unknown; a pixel that nothing is known of is off. 0 without any truth.
    """
    right = known = 0
    for depth, truth in zip(found, true, strict=True):
        seen = truth > 0.0
        right += int((np.abs(depth[seen] - truth[seen]) <= tolerance * truth[seen]).sum())
        known += int(seen.sum())
    return right / max(known, 1)


@dataclass(frozen=True)
class DepthError:
    """Of pixels with a true depth: the median of |found - true| / true, and the share within ``RIGHT_DEPTH``."""

    median: float
    right: float

    @staticmethod
    def of(found: Sequence[np.ndarray], true: Sequence[np.ndarray]) -> DepthError | None:
        """Over all maps (H, W) together, planar metres; a pixel where nothing is found is off by its whole depth.

        None without any truth.
        """
        pairs = [(depth[truth > 0.0], truth[truth > 0.0]) for depth, truth in zip(found, true, strict=True)]
        errors = np.concatenate([np.abs(depth - truth) / truth for depth, truth in pairs] or [np.zeros(0)])
        return DepthError(float(np.median(errors)), within(found, true, RIGHT_DEPTH)) if len(errors) else None


class Surface:
    """A triangle mesh that tells how far points lie from it.

    ``samples`` points are drawn on it; of a point, the distance to the faces of the few
    samples nearest to it is taken. It is exact where the nearest face is one of them, as it
    nearly always is, and never farther off than samples lie apart. ``vertices`` (V, 3),
    ``faces`` (F, 3). Raises EvaluationError for a surface without area, or with vertices
    that are not finite.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, samples: int, rng: np.random.Generator) -> None:
        mesh = trimesh.Trimesh(np.asarray(vertices, np.float64), np.asarray(faces), process=False)
        if not np.isfinite(mesh.vertices).all() or not len(mesh.faces) or not mesh.area > 0.0:
            raise EvaluationError("a surface without area cannot be scored", cure="Give a whole mesh.")
        points, drawn = trimesh.sample.sample_surface(mesh, samples, seed=rng)
        self.samples = np.asarray(points)
        """(samples, 3) float64, the same number on every unit of area."""
        # A face too small to be hit by a sample is found by its centre.
        self._triangles = np.asarray(mesh.triangles)
        whole = np.flatnonzero(mesh.area_faces > 0.0)
        self._face = np.concatenate([drawn, whole])
        self._tree = cKDTree(np.concatenate([self.samples, self._triangles[whole].mean(axis=1)]))

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(P,) float64 distances of ``points`` (P, 3), and (P,) the faces nearest to them."""
        points = np.asarray(points, np.float64).reshape(-1, 3)
        distance, face = np.empty(len(points)), np.empty(len(points), np.int64)
        among = min(_NEAREST_SAMPLES, len(self._face))
        for start in range(0, len(points), _CHUNK):
            chunk = points[start : start + _CHUNK]
            _, near = self._tree.query(chunk, k=among, workers=-1)
            candidates = np.sort(self._face[near.reshape(len(chunk), among)], axis=1)
            first = np.ones(candidates.shape, bool)  # of each face, once a point
            first[:, 1:] = candidates[:, 1:] != candidates[:, :-1]
            repeated = chunk[np.nonzero(first)[0]]
            closest = trimesh.triangles.closest_point(self._triangles[candidates[first]], repeated)
            apart = np.full(candidates.shape, np.inf)
            apart[first] = np.linalg.norm(closest - repeated, axis=1)
            best = apart.argmin(axis=1)[:, None]
            distance[start : start + _CHUNK] = np.take_along_axis(apart, best, axis=1)[:, 0]
            face[start : start + _CHUNK] = np.take_along_axis(candidates, best, axis=1)[:, 0]
        return distance, face

    def distance(self, points: np.ndarray) -> np.ndarray:
        """(P,) float64 distances of ``points`` (P, 3)."""
        return self.nearest(points)[0]


@dataclass(frozen=True)
class SurfaceScore:
    """``precision``: share of the found surface's area within ``SURFACE_TOLERANCE_M`` of the
    true one; ``recall``: share of what the captures truly see within it of the found one;
    ``fscore``: their harmonic mean; ``median_error_m``: of the found surface's distances."""

    precision: float
    recall: float
    fscore: float
    median_error_m: float


def surface_score(found: Surface, true: Surface, visible: np.ndarray) -> SurfaceScore:
    """Score a surface, in one frame with the true one, metres.

    Precision takes the points drawn on it and their distance to the true surface, seen or not. Recall takes the
    points (P, 3) that captures truly see, one in a voxel of 2 cm, and their distance to the points drawn on it.
    """
    errors = true.distance(found.samples)
    missed, _ = cKDTree(found.samples).query(visible, workers=-1)
    precision = float((errors <= SURFACE_TOLERANCE_M).mean())
    recall = float((missed <= SURFACE_TOLERANCE_M).mean()) if len(missed) else 0.0
    both = precision + recall
    fscore = 2.0 * precision * recall / both if both else 0.0
    return SurfaceScore(precision, recall, fscore, float(np.median(errors)))

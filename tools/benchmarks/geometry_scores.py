"""Scores of geometry against ground truth: depth maps, the proxy's surface, aligned priors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from r2sego_blender.core.cameras import rotation_angle_rad
from r2sego_blender.core.errors import EvaluationError
from r2sego_blender.core.images import resize_nearest
from r2sego_blender.evaluation.ground_truth import GroundTruth

DEPTH_TOLERANCE = 0.03
"""A depth is right within this share of the true one."""

SURFACE_TOLERANCE_M = 0.05
"""Distance within which two surfaces are taken to be one, of the F-score."""

_VISIBLE_SPACING_M = 0.02
_PROXY_SAMPLES = 200_000
_TRUTH_SAMPLES = 600_000
_PRIOR_SAMPLES = 20_000
_NEAREST_SAMPLES = 8  # whose faces are looked at exactly
_CHUNK = 20_000  # points whose exact distances are computed at a time


@dataclass(frozen=True)
class DepthScore:
    """``coverage``: share of all pixels with a depth; ``accuracy``: share of those, where the
    truth is known, within ``DEPTH_TOLERANCE`` of it (0 when there is none)."""

    coverage: float
    accuracy: float


def depth_score(found: Sequence[np.ndarray], true: Sequence[np.ndarray]) -> DepthScore:
    """Score depth maps (H, W), 0 where nothing is known, over all their pixels together.

    The true maps are brought to the size of those found, nearest pixel's. Raises
    EvaluationError when there is none, or their numbers differ.
    """
    if not found or len(found) != len(true):
        raise EvaluationError(
            f"{len(found)} depth maps cannot be scored against {len(true)}", cure="Give one true depth map for each."
        )
    pixels = covered = compared = right = 0
    for depth, truth in zip(found, true, strict=True):
        truth = resize_nearest(truth, *depth.shape)
        known = (depth > 0.0) & (truth > 0.0)
        near = np.abs(depth[known] - truth[known]) <= DEPTH_TOLERANCE * truth[known]
        pixels, covered = pixels + depth.size, covered + int((depth > 0.0).sum())
        compared, right = compared + int(known.sum()), right + int(near.sum())
    return DepthScore(covered / pixels, right / max(compared, 1))


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


def surface_score(
    vertices: np.ndarray, faces: np.ndarray, truth: GroundTruth, rng: np.random.Generator
) -> SurfaceScore:
    """Score a mesh, ``vertices`` (V, 3) and ``faces`` (F, 3), in the frame of ``truth``, metres.

    Precision takes points drawn on the mesh and their distance to the true surface, seen or
    not. Recall takes the captures' true depth as points, one in a voxel of 2 cm, and their
    distance to the points drawn on the mesh.
    """
    found = Surface(vertices, faces, _PROXY_SAMPLES, rng)
    true = Surface(truth.vertices, truth.faces, _TRUTH_SAMPLES, rng)
    errors = true.distance(found.samples)
    missed, _ = cKDTree(found.samples).query(truth.visible_points(_VISIBLE_SPACING_M), workers=-1)
    precision = float((errors <= SURFACE_TOLERANCE_M).mean())
    recall = float((missed <= SURFACE_TOLERANCE_M).mean()) if len(missed) else 0.0
    both = precision + recall
    fscore = 2.0 * precision * recall / both if both else 0.0
    return SurfaceScore(precision, recall, fscore, float(np.median(errors)))


@dataclass(frozen=True)
class AlignmentScore:
    """How far a prior lies from its true place.

    ``translation_m`` of its bounding box's centre, ``rotation_deg``, ``scale_percent`` of
    the true scale, all >= 0; ``chamfer_m`` the mean distance of its surface to the true one
    and of the true one to it, halved.
    """

    translation_m: float
    rotation_deg: float
    scale_percent: float
    chamfer_m: float


def alignment_score(
    world_from_prior: np.ndarray,
    true_world_from_prior: np.ndarray,
    vertices: np.ndarray,
    faces: np.ndarray,
    rng: np.random.Generator,
    symmetries: Sequence[np.ndarray] = (),
) -> AlignmentScore:
    """Score an estimated similarity (4, 4) of a prior against the true one.

    ``vertices`` (V, 3) and ``faces`` (F, 3) are the prior's own, in its frame.
    ``symmetries`` are rigid (4, 4) maps of that frame which leave the shape as it is,
    the identity apart: with each of them the true place is as true, and the one
    nearest in rotation counts. Raises EvaluationError for what is no similarity.
    """
    estimated_scale, estimated_rotation = _scale_and_rotation(world_from_prior)
    true_scale, _ = _scale_and_rotation(true_world_from_prior)
    equally_true = [true_world_from_prior @ one for one in (np.eye(4), *symmetries)]
    angles = [rotation_angle_rad(estimated_rotation, _scale_and_rotation(one)[1]) for one in equally_true]
    true = equally_true[int(np.argmin(angles))]
    centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2.0
    apart = _moved(centre, world_from_prior) - _moved(centre, true)
    return AlignmentScore(
        translation_m=float(np.linalg.norm(apart)),
        rotation_deg=float(np.degrees(min(angles))),
        scale_percent=100.0 * abs(estimated_scale / true_scale - 1.0),
        chamfer_m=chamfer_distance_m((_moved(vertices, world_from_prior), faces), (_moved(vertices, true), faces), rng),
    )


def chamfer_distance_m(
    a: tuple[np.ndarray, np.ndarray], b: tuple[np.ndarray, np.ndarray], rng: np.random.Generator
) -> float:
    """Mean distance from one mesh (vertices, faces) to the other and back, halved; metres."""
    first, second = (Surface(*mesh, _PRIOR_SAMPLES, rng) for mesh in (a, b))
    there, back = second.distance(first.samples), first.distance(second.samples)
    return float((there.mean() + back.mean()) / 2.0)


def _moved(points: np.ndarray, similarity: np.ndarray) -> np.ndarray:
    moved: np.ndarray = points @ similarity[:3, :3].T + similarity[:3, 3]
    return moved


def _scale_and_rotation(similarity: np.ndarray) -> tuple[float, np.ndarray]:
    linear = np.asarray(similarity, np.float64)[:3, :3]
    scale = float(np.cbrt(np.linalg.det(linear)))
    if not scale > 0.0 or not np.allclose(linear.T @ linear, scale**2 * np.eye(3), atol=1e-6 * scale**2):
        raise EvaluationError(
            "the prior's transform is no similarity", cure="Give a scale, a rotation and a translation."
        )
    return scale, linear / scale

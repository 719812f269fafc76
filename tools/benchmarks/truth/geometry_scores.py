"""Scores of geometry against ground truth: depth maps, the proxy's surface, aligned priors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2sego_blender.core.cameras import rotation_angle_rad
from r2sego_blender.core.errors import EvaluationError
from r2sego_blender.core.images import resize_nearest
from r2sego_blender.evaluation.ground_truth import GroundTruth
from r2sego_blender.evaluation.surfaces.geometry_errors import (
    FOUND_SAMPLES,
    TRUE_SAMPLES,
    VISIBLE_SPACING_M,
    Surface,
    SurfaceScore,
    surface_score,
)

DEPTH_TOLERANCE = 0.03
"""A depth is right within this share of the true one."""

_PRIOR_SAMPLES = 20_000


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


def mesh_score(vertices: np.ndarray, faces: np.ndarray, truth: GroundTruth, rng: np.random.Generator) -> SurfaceScore:
    """Score a mesh, ``vertices`` (V, 3) and ``faces`` (F, 3), in the frame of ``truth``, metres."""
    found = Surface(vertices, faces, FOUND_SAMPLES, rng)
    true = Surface(truth.vertices, truth.faces, TRUE_SAMPLES, rng)
    return surface_score(found, true, truth.visible_points(VISIBLE_SPACING_M))


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

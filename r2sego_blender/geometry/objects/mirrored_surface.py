"""The surface that an object's symmetry adds to what was observed of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from ..mesh.meshes import compacted, component_areas
from ..stereo.evidence import KnownDepth, collect_votes
from ..surfaces.tsdf import DistanceField
from .symmetry import MirrorPlane, ObjectSight

_VOXEL_M, _TRUNCATION_M = 0.02, 0.05
_OUTLIERS = 0.01  # share of the points at each end that the surface need not reach
_OBSERVED_M = 0.03  # nearer to observed points, the surface was observed
_MOST_WRONG = 0.5  # of what captures may say against a face
_FREE_MARGIN = 0.03  # relative depth by which a capture must see past a face
_LEAST_M2 = 0.02  # of a connected part


def mirrored_surface(
    planes: Sequence[MirrorPlane],
    points: np.ndarray,
    masks: Sequence[np.ndarray],
    reliable: Sequence[np.ndarray],
    sight: ObjectSight,
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) and faces (F, 3) int32 of what was not observed itself, but its image was.

    ``points`` (P, 3), ``masks`` (H, W) bool and ``reliable`` depths (H, W) are the object's.
    Captures and their mirror images are fused; faces that a capture speaks against are left
    out. Both are empty where symmetry adds nothing.
    """
    views = [
        (camera, np.where(mask, depth, 0)) for camera, mask, depth in zip(sight.cameras, masks, reliable, strict=True)
    ]
    reached = points
    for plane in planes:
        views += [(plane.mirrored_camera(camera), depth[:, ::-1]) for camera, depth in views]
        reached = np.concatenate([reached, plane.mirrored(reached)])
    low, high = np.quantile(reached, [_OUTLIERS, 1 - _OUTLIERS], axis=0)
    field = DistanceField.covering(low - _TRUNCATION_M, high + _TRUNCATION_M, _VOXEL_M, _TRUNCATION_M)
    for camera, depth in views:
        field.integrate(camera, depth, np.ones(depth.shape, np.float32))
    vertices, faces = field.surface()
    if len(faces):
        centroids = vertices[faces].mean(1)
        known = [KnownDepth(c, depth) for c, depth in zip(sight.cameras, reliable, strict=True)]
        votes = collect_votes(centroids, known, _FREE_MARGIN)
        new = cKDTree(points).query(centroids)[0] > _OBSERVED_M
        faces = faces[new & (sight.judged(centroids)[1] < _MOST_WRONG) & (votes.through <= votes.agree)]
    if len(faces):
        faces = faces[component_areas(vertices, faces) >= _LEAST_M2]
    return compacted(vertices, faces)

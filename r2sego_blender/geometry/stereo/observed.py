"""Fusion of the captures' depth into the observed geometry: points and their support record.

The paper (Sec. "Capture-Anchored Geometry Proxy") triangulates tracks of the registered
captures; here the points are those of the dense stereo that two captures agree on.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from ...captures.capture import Capture
from ...captures.sparse_points import SparsePoints
from ...config.settings import StereoSettings
from ...core.errors import GeometryError
from ...core.images import resize
from .consistency import agreement
from .observed_geometry import ObservedGeometry
from .stereo import DepthMap

# Captures that must agree on a fused point, and that must have measured a sparse one:
# a track of two wide views is a chance match too often.
_MIN_DENSE_VIEWS = 2
_MIN_SPARSE_VIEWS = 3
_MAX_SPARSE_ERROR_PX = 1.0
# A sparse point is less sure than a dense one: nothing says how its surface lies.
_SPARSE_CONFIDENCE = 0.3
# Points of one voxel fuse with its surest point when their normals lie within 60 degrees.
_MIN_FUSED_COSINE = 0.5
# An outlier lies this many times further from its neighbours than points usually do.
_OUTLIER_NEIGHBOURS = 8
_OUTLIER_FACTOR = 3.0


def observe(
    captures: Sequence[Capture], depth_maps: Sequence[DepthMap], sparse: SparsePoints | None, settings: StereoSettings
) -> ObservedGeometry:
    """The reliable depth of all captures as one set of points, a voxel apart.

    ``A_obs`` marks the captures whose reliable depth agrees with a point; those that
    fewer than two mark are dropped, but where a sensor measured them. Where stereo has nothing,
    points of ``sparse`` that three captures measured are added with their own record.
    Deterministic. There may be no point at all: ``require_observed``.
    """
    reliable = [np.where(m.reliable(settings), m.depth, np.float32(0.0)) for m in depth_maps]
    samples = [_samples(c, m, d) for c, m, d in zip(captures, depth_maps, reliable, strict=True)]
    points, normals, colours, confidence, measured = (np.concatenate(parts) for parts in zip(*samples, strict=True))
    if len(points) == 0:
        return ObservedGeometry.none(len(captures))
    points, normals, colours, confidence, surest = one_a_voxel(
        points, normals, colours, confidence, settings.point_spacing_m
    )
    measured = measured[surest]
    visibility = _visibility(points, depth_maps, reliable, settings)
    seen = visibility.sum(axis=1)
    kept = (seen >= _MIN_DENSE_VIEWS) | (measured & (seen >= 1))
    kept[kept] = _dense_enough(points[kept])
    if not kept.any():
        return ObservedGeometry.none(len(captures))
    dense = ObservedGeometry(
        points[kept].astype(np.float32),
        normals[kept].astype(np.float32),
        colours[kept].astype(np.float32),
        visibility[kept],
        confidence[kept].astype(np.float32),
        measured[kept],
    )
    return dense if sparse is None else _with_sparse(dense, sparse, depth_maps, settings)


def require_observed(observed: ObservedGeometry) -> None:
    """Raise GeometryError where there is no point at all."""
    if not len(observed.points):
        raise GeometryError(
            "no depth is supported by two photographs",
            where="observed geometry",
            cure="Check the poses, or add photographs that overlap more.",
        )


def _samples(
    capture: Capture, depth_map: DepthMap, reliable: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points (n, 3), normals, colours and confidence (n,) of a capture's reliable pixels, and which a
    sensor measured (n,)."""
    camera = depth_map.camera
    mask = reliable > 0.0
    image = resize(capture.image(), camera.width, camera.height)
    # Each further capture that agrees halves the doubt its matching cost leaves.
    support = depth_map.support[mask].astype(np.float64)
    confidence = (1.0 - depth_map.cost[mask].clip(0.0, 1.0)) * (1.0 - 0.5**support)
    measured = np.zeros(len(confidence), bool)
    if depth_map.measured is not None:
        measured = depth_map.measured[mask]
        # Nobody need confirm what was measured: its cost says how sure it is.
        confidence[measured] = 1.0 - depth_map.cost[mask][measured]
    return camera.unproject(reliable)[mask], depth_map.normal[mask], image[mask], confidence, measured


def one_a_voxel(
    points: np.ndarray, normals: np.ndarray, colours: np.ndarray, confidence: np.ndarray, spacing_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points (n, 3), normals (n, 3), colours (n, 3) and confidence (n,), one a voxel: the mean of its points by
    confidence, of the surest one's side; with the surest's index (n,) among all."""
    cells = np.floor(points / spacing_m).astype(np.int64)
    order = np.lexsort((-confidence, cells[:, 2], cells[:, 1], cells[:, 0]))
    cells = cells[order]
    starts = np.flatnonzero(np.r_[True, (np.diff(cells, axis=0) != 0).any(axis=1)])
    voxel = np.repeat(np.arange(len(starts)), np.diff(np.r_[starts, len(order)]))
    points, normals, colours = points[order], normals[order].astype(np.float64), colours[order]
    surest = normals[starts][voxel]
    weight = confidence[order] + 1e-6
    weight = np.where((normals * surest).sum(axis=1) >= _MIN_FUSED_COSINE, weight, 0.0)[:, None]
    total = np.add.reduceat(weight, starts)
    means = [np.add.reduceat(weight * a, starts) / total for a in (points, normals, colours)]
    means[1] /= np.linalg.norm(means[1], axis=1, keepdims=True)
    return means[0], means[1], means[2], confidence[order][starts], order[starts]


def _visibility(
    points: np.ndarray, depth_maps: Sequence[DepthMap], reliable: Sequence[np.ndarray], settings: StereoSettings
) -> np.ndarray:
    """(P, N) bool: the captures whose reliable depth agrees with each point."""
    return np.stack(
        [
            agreement(points, m.camera, depth, m.normal, settings.consistency)
            for m, depth in zip(depth_maps, reliable, strict=True)
        ],
        axis=1,
    )


def _dense_enough(points: np.ndarray) -> np.ndarray:
    """(P,) bool: the points about as near to their neighbours as points usually are."""
    if len(points) <= _OUTLIER_NEIGHBOURS:
        return np.ones(len(points), bool)
    distances, _ = cKDTree(points).query(points, k=_OUTLIER_NEIGHBOURS + 1)
    mean = distances[:, 1:].mean(axis=1)
    return mean <= _OUTLIER_FACTOR * np.median(mean)


def _with_sparse(
    dense: ObservedGeometry, sparse: SparsePoints, depth_maps: Sequence[DepthMap], settings: StereoSettings
) -> ObservedGeometry:
    """``dense`` and the well-measured sparse points further than a few voxels from it,
    facing the captures that measured them."""
    reach_m = _OUTLIER_FACTOR * settings.point_spacing_m
    distance, _ = cKDTree(dense.points).query(sparse.points)
    added = (sparse.visibility.sum(axis=1) >= _MIN_SPARSE_VIEWS) & (distance > reach_m)
    added &= sparse.error_px <= _MAX_SPARSE_ERROR_PX
    points, seen = sparse.points[added], sparse.visibility[added]
    centres = np.array([m.camera.centre for m in depth_maps])
    towards = (seen[..., None] * centres).sum(axis=1) / seen.sum(axis=1, keepdims=True) - points
    normals = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    confidence = np.full(len(points), _SPARSE_CONFIDENCE)
    return dense.joined(ObservedGeometry(points, normals, sparse.colours[added] / 255.0, seen, confidence))

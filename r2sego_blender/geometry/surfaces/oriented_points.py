"""Oriented points of weighted depth maps: what Poisson reconstruction and NKSR start from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ...core.cameras import Camera

_LARGEST_SLOPE = 8.0  # depth per sideways metre beyond which two pixels lie on different surfaces
_NEIGHBOURS = 24
_FACING = 0.5  # cosine from which a neighbour lies on the same side of a thin thing


@dataclass(frozen=True)
class WeightedDepth:
    """A planar depth map ``depth`` (H, W) in metres, 0 = unknown, of ``camera``, and the
    evidence for each pixel, ``weight`` (H, W) >= 0."""

    camera: Camera
    depth: np.ndarray
    weight: np.ndarray


@dataclass(frozen=True)
class OrientedPoints:
    """``points`` (P, 3) in the world, metres, and unit ``normals`` (P, 3) towards free space."""

    points: np.ndarray
    normals: np.ndarray

    @staticmethod
    def of(
        views: Sequence[WeightedDepth], low: np.ndarray, high: np.ndarray, spacing_m: float, reach_m: float
    ) -> OrientedPoints:
        """One point for each cell of ``spacing_m`` between ``low`` and ``high`` (3,) that a view sees.

        Where views disagree by less than ``reach_m``, points are drawn onto the plane that
        the evidence around them agrees on, as a fused distance field does.
        """
        samples = [_samples(view) for view in views] or [np.zeros((0, 7))]
        points, normals, weights = np.split(np.concatenate(samples), [3, 6], axis=1)
        inside = ((points >= low) & (points <= high)).all(1)
        points, normals, weights = points[inside], normals[inside], weights[inside]
        if not len(points):
            return OrientedPoints(np.zeros((0, 3)), np.zeros((0, 3)))
        # Both sides of a thin thing keep points of their own.
        cells = np.column_stack([np.floor((points - low) / spacing_m), _octant(normals)]).astype(np.int64)
        _, cell = np.unique(cells, axis=0, return_inverse=True)
        cell = cell.ravel()
        total = np.bincount(cell, weights[:, 0])
        points, normals = (
            np.stack([np.bincount(cell, weights[:, 0] * values[:, axis]) for axis in range(3)], 1) / total[:, None]
            for values in (points, normals)
        )
        return OrientedPoints(*_agreed(points, _unit(normals), total, reach_m))


def _samples(view: WeightedDepth) -> np.ndarray:
    """(n, 7): point, normal and weight of the pixels whose four neighbours lie on their surface."""
    points = view.camera.unproject(view.depth)
    depth = np.asarray(view.depth, np.float64)
    right, down = points[1:-1, 2:] - points[1:-1, :-2], points[2:, 1:-1] - points[:-2, 1:-1]
    normal = np.cross(down, right)  # towards the camera, since rows go down
    middle = (slice(1, -1), slice(1, -1))
    smooth = (depth[middle] > 0) & (view.weight[middle] > 0)
    for neighbour, focal in (
        (depth[1:-1, 2:], view.camera.fx),
        (depth[1:-1, :-2], view.camera.fx),
        (depth[2:, 1:-1], view.camera.fy),
        (depth[:-2, 1:-1], view.camera.fy),
    ):
        step = np.abs(neighbour - depth[middle])
        smooth &= (neighbour > 0) & (step * focal < _LARGEST_SLOPE * depth[middle])
    weight = np.asarray(view.weight, np.float64)[middle][smooth]
    return np.column_stack([points[middle][smooth], _unit(normal[smooth]), weight])


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def _octant(normals: np.ndarray) -> np.ndarray:
    """(n,) which of six directions a normal turns to most."""
    axis = np.abs(normals).argmax(1)
    return 2 * axis + (np.take_along_axis(normals, axis[:, None], 1)[:, 0] > 0)


def _agreed(
    points: np.ndarray, normals: np.ndarray, weights: np.ndarray, reach_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals after one step of weighted moving planes."""
    count = min(_NEIGHBOURS, len(points))
    distance, near = cKDTree(points).query(points, k=[*range(1, count + 1)], distance_upper_bound=reach_m)
    near = np.minimum(near, len(points) - 1)
    cosine = np.einsum("ijk,ik->ij", normals[near], normals)
    share = weights[near] * np.where(np.isfinite(distance) & (cosine > _FACING), 1.0, 0.0)
    share *= 1.0 - np.where(np.isfinite(distance), distance / reach_m, 1.0) ** 2
    total = np.maximum(share.sum(1), 1e-12)
    offset = np.einsum("ijk,ik->ij", points[near] - points[:, None], normals)
    moved = points + normals * ((share * offset).sum(1) / total)[:, None]
    return moved, _unit(np.einsum("ij,ijk->ik", share, normals[near]))

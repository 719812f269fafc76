"""A truncated signed distance field fused from depth maps (Curless and Levoy, 1996)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from skimage.measure import marching_cubes

from ...core.cameras import Camera
from ...core.compiled import parallel_kernel, prange
from ..mesh.meshes import compacted
from ..visibility.projection import depth_of, pixel_of
from .oriented_points import WeightedDepth

BACKENDS = {"tsdf": "embedded: TSDF of completed depth"}
ORDER = 0


@dataclass(frozen=True)
class DistanceField:
    """Voxels at ``origin + index * voxel_m``: ``distance`` (X, Y, Z) float32 is the weighted
    sum of signed distances in units of the truncation, positive in free space; ``weight``
    (X, Y, Z) float32 its total weight, 0 where nothing is known."""

    origin: np.ndarray
    voxel_m: float
    truncation_m: float
    distance: np.ndarray
    weight: np.ndarray

    @staticmethod
    def covering(low: np.ndarray, high: np.ndarray, voxel_m: float, truncation_m: float) -> DistanceField:
        """An empty field over the box from ``low`` to ``high`` (3,), metres, in the world."""
        shape = tuple(np.ceil((high - low) / voxel_m).astype(int) + 1)
        return DistanceField(
            np.asarray(low, np.float64), voxel_m, truncation_m, np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        )

    def integrate(self, camera: Camera, depth: np.ndarray, weight: np.ndarray) -> None:
        """Add a planar depth map (H, W), 0 = unknown, with its per-pixel weight (H, W)."""
        _integrate(
            self.distance,
            self.weight,
            self.origin,
            self.voxel_m,
            self.truncation_m,
            camera.camera_from_world[:3],
            np.array([camera.fx, camera.fy, camera.cx, camera.cy]),
            np.ascontiguousarray(depth, np.float32),
            np.ascontiguousarray(weight, np.float32),
        )

    def surface(self) -> tuple[np.ndarray, np.ndarray]:
        """Marching cubes between known voxels: vertices (V, 3) float64 and faces (F, 3) int32,
        counter-clockwise from the free side; empty arrays where there is no surface."""
        known = self.weight > 0
        # Where a surface meets the unknown, its sheet is cut off: the mesher's own mask looks
        # at one corner of a cell alone and leaves ghosts a truncation behind every surface.
        field = np.where(known, self.distance / np.maximum(self.weight, 1e-12), 1.0)
        if not (field.min() < 0 < field.max()):
            return np.zeros((0, 3)), np.zeros((0, 3), np.int32)
        vertices, faces, _, _ = marching_cubes(field, 0.0, gradient_direction="descent")
        cell = np.floor(vertices[faces].mean(1)).astype(int)
        cell = np.minimum(cell, np.array(field.shape) - 2)
        inside = np.ones(len(faces), bool)
        for corner in np.ndindex(2, 2, 2):
            inside &= known[tuple((cell + corner).T)]
        vertices, faces = compacted(vertices, faces[inside])
        return vertices * self.voxel_m + self.origin, faces


def surface(views: Sequence[WeightedDepth], field: DistanceField) -> tuple[np.ndarray, np.ndarray]:
    """The zero level of the truncated distances of all views, fused in ``field``."""
    for view in views:
        field.integrate(view.camera, view.depth, view.weight)
    return field.surface()


@parallel_kernel
def _integrate(distance, total, origin, voxel, truncation, pose, lens, depth, weight):
    height, width = depth.shape
    count_x, count_y, count_z = distance.shape
    for i in prange(count_x):
        x = origin[0] + i * voxel
        for j in range(count_y):
            y = origin[1] + j * voxel
            for k in range(count_z):
                z = origin[2] + k * voxel
                forward = depth_of(pose, x, y, z)
                if forward < 0.05:
                    continue
                u, v = pixel_of(pose, lens, x, y, z, forward)
                if not (0.0 <= u < width and 0.0 <= v < height):
                    continue
                row, column = int(v), int(u)
                if depth[row, column] <= 0.0:
                    continue
                signed = (depth[row, column] - forward) / truncation
                if signed > -1.0:
                    w = weight[row, column]
                    distance[i, j, k] += np.float32(w * min(signed, 1.0))
                    total[i, j, k] += w

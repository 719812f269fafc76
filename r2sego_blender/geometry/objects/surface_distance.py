"""Distances of points to a shape's surface, fast enough for thousands of poses.

A grid knows for each of its corners the nearest sample of the surface. A point asks the
eight corners around it; the nearest of their samples is nearly always the point's own. By
the distance to its tangent plane the samples' spacing does not matter.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from ...core.compiled import kernel
from ...core.errors import GeometryError

_SAMPLES = 12_000
_MOST_SAMPLES, _LEAST_SPREAD = (0.95, 0.05), 1e-6
_CELLS = 40  # along each side of the grid
_MARGIN = 0.1  # of the grid around the shape; further points see the grid's border
_PLANE_REACH = 0.03  # beyond it a sample's tangent plane is not the surface


class SurfaceGrid(NamedTuple):
    """``samples`` (S, 3) of a surface of size 1 with unit ``normals`` (S, 3); ``nearest`` (N, N, N)
    int32: the sample nearest to each corner of a grid from ``low`` in all axes, ``step`` apart."""

    samples: np.ndarray
    normals: np.ndarray
    nearest: np.ndarray
    low: float
    step: float

    @staticmethod
    def of(vertices: np.ndarray, faces: np.ndarray) -> SurfaceGrid:
        """The grid of a mesh whose box is centred and has a diagonal of 1.

        Raises GeometryError where nearly all of its surface is a speck in the box.
        """
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        samples, face = trimesh.sample.sample_surface(mesh, _SAMPLES, seed=0)
        samples = np.ascontiguousarray(samples, np.float64)
        spread = np.subtract(*np.quantile(samples, _MOST_SAMPLES, axis=0))
        if not spread.max() > _LEAST_SPREAD:  # samples at one place would be compared one by one
            raise GeometryError(
                "nearly all of the mesh's surface is a speck in its box",
                cure="Remove the vertices far from the object.",
            )
        half = float(np.abs(vertices).max()) + _MARGIN
        line = np.linspace(-half, half, _CELLS)
        corners = np.stack(np.meshgrid(line, line, line, indexing="ij"), -1)
        nearest = cKDTree(samples).query(corners.reshape(-1, 3), workers=-1)[1].astype(np.int32)
        normals = np.ascontiguousarray(mesh.face_normals[face], np.float64)
        return SurfaceGrid(samples, normals, nearest.reshape(corners.shape[:3]), -half, 2 * half / (_CELLS - 1))

    def distances(self, points: np.ndarray) -> np.ndarray:
        """(P,) distances of ``points`` (P, 3) to the surface, in its own unit."""
        points = np.ascontiguousarray(points, np.float64)
        found = np.empty(len(points))
        _distances(self, points, found)
        return found


@kernel
def _distances(grid, points, found):
    for p in range(points.shape[0]):
        found[p] = surface_distance(grid, points[p, 0], points[p, 1], points[p, 2])


@kernel
def surface_distance(grid, x, y, z):
    """The distance of one point."""
    last = grid.nearest.shape[0] - 1
    i = min(max(int(np.floor((x - grid.low) / grid.step)), 0), last - 1)
    j = min(max(int(np.floor((y - grid.low) / grid.step)), 0), last - 1)
    k = min(max(int(np.floor((z - grid.low) / grid.step)), 0), last - 1)
    best, at = np.inf, 0
    for corner in range(8):
        s = grid.nearest[i + (corner & 1), j + (corner >> 1 & 1), k + (corner >> 2)]
        dx, dy, dz = x - grid.samples[s, 0], y - grid.samples[s, 1], z - grid.samples[s, 2]
        square = dx * dx + dy * dy + dz * dz
        if square < best:
            best, at = square, s
    distance = np.sqrt(best)
    if distance > _PLANE_REACH:
        return distance
    n, s = grid.normals[at], grid.samples[at]
    return abs((x - s[0]) * n[0] + (y - s[1]) * n[1] + (z - s[2]) * n[2])

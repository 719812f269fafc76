"""How far points stand out of an open surface into the free space it faces."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ...core.compiled import kernel

_SPACING_M = 0.03  # of the surface's samples
_CELL_M = 0.06
_MOST_CELLS = 2e7
_MOST_PARTS = 250  # a triangle's sides are divided into


@dataclass(frozen=True)
class FreeSide:
    """Samples of a surface in a grid, and, where ``floored``, all of z = 0.

    ``points`` (S, 3) with unit ``normals`` (S, 3) towards the free side, at most ``_SPACING_M``
    apart, sorted by the grid's cells: those of cell c are ``first[c]`` up to ``first[c + 1]``.
    ``low`` (3,) is the grid's corner, ``shape`` (3,) its number of cells, one of them free on
    every side, and ``cell_m`` their side.
    """

    points: np.ndarray
    normals: np.ndarray
    first: np.ndarray
    low: np.ndarray
    shape: np.ndarray
    cell_m: float
    floored: bool
    tree: cKDTree

    @staticmethod
    def of(corners: np.ndarray, normals: np.ndarray, floored: bool) -> FreeSide:
        """The free side of triangles (T, 3, 3), at least one, with unit normals (T, 3)."""
        points, triangle = sampled(corners, parts_by_side(corners, _SPACING_M))
        size = np.ptp(points, axis=0)
        cell_m = max(_CELL_M, float(np.cbrt(np.prod(size + _CELL_M) / _MOST_CELLS)))
        low = points.min(0) - 1.5 * cell_m
        shape = np.floor((points.max(0) - low) / cell_m).astype(np.int64) + 2
        i, j, k = np.floor((points - low) / cell_m).astype(np.int64).T
        cell = (i * shape[1] + j) * shape[2] + k
        order = np.argsort(cell, kind="stable")
        first = np.searchsorted(cell[order], np.arange(shape.prod() + 1))
        points = np.ascontiguousarray(points[order])
        return FreeSide(
            points, np.ascontiguousarray(normals[triangle[order]]), first, low, shape, cell_m, floored, cKDTree(points)
        )

    def standing_out(self, points: np.ndarray) -> np.ndarray:
        """(N,) metres from the surface at which points (N, 3) are in free space; what is not
        positive is on the surface or behind it.

        The nearest sample says on which side a point is, all those near it how far away.
        """
        points = np.ascontiguousarray(points, np.float64)
        out = np.empty(len(points))
        _standing_out(points, self.points, self.normals, self.first, self.low, self.shape, self.cell_m, out)
        far = np.flatnonzero(np.isinf(out))
        if len(far):
            distance, nearest = self.tree.query(points[far])
            height = ((points[far] - self.points[nearest]) * self.normals[nearest]).sum(1)
            out[far] = np.where(height > 0.0, distance, -distance)
        return np.minimum(out, points[:, 2]) if self.floored else out


@kernel
def _standing_out(points, samples, normals, first, low, shape, cell_m, out):
    """``out`` (N,): signed distances, inf where no sample is as near as a cell's side."""
    for index in range(len(points)):
        x, y, z = points[index]
        i = int(np.floor((x - low[0]) / cell_m))
        j = int(np.floor((y - low[1]) / cell_m))
        k = int(np.floor((z - low[2]) / cell_m))
        nearest, least, side = cell_m * cell_m, np.inf, 0.0
        for a in range(max(i - 1, 0), min(i + 2, shape[0])):
            for b in range(max(j - 1, 0), min(j + 2, shape[1])):
                row = (a * shape[1] + b) * shape[2]
                start, end = max(k - 1, 0), min(k + 2, shape[2])
                if start >= end:
                    continue
                for sample in range(first[row + start], first[row + end]):
                    dx, dy, dz = x - samples[sample, 0], y - samples[sample, 1], z - samples[sample, 2]
                    square = dx * dx + dy * dy + dz * dz
                    height = dx * normals[sample, 0] + dy * normals[sample, 1] + dz * normals[sample, 2]
                    beside = max(np.sqrt(max(square - height * height, 0.0)) - _SPACING_M, 0.0)
                    least = min(least, height * height + beside * beside)
                    if square < nearest:
                        nearest, side = square, height
        if nearest == cell_m * cell_m:
            out[index] = np.inf
        else:
            out[index] = np.sqrt(least) if side > 0.0 else -np.sqrt(least)


def parts_by_side(corners: np.ndarray, spacing_m: float) -> np.ndarray:
    """(T,) into how many parts the sides of triangles (T, 3, 3) are cut to be that short."""
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(1)
    return np.clip(np.ceil(sides / spacing_m), 1, _MOST_PARTS).astype(int)


def parts_by_area(double_areas: np.ndarray, spacing_m: float) -> np.ndarray:
    """(T,) parts of the sides for about a point a square of this side: few on slivers."""
    return np.clip(np.ceil(np.sqrt(double_areas / 2) / spacing_m), 1, _MOST_PARTS).astype(int)


def sampled(corners: np.ndarray, parts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (S, 3) on triangles (T, 3, 3) and the triangle (S,) of each.

    A triangle's sides are cut into ``parts`` (T,); the points are the centroids of the equal
    triangles that come of it.
    """
    points, triangles = [], []
    for count in np.unique(parts):
        chosen = np.flatnonzero(parts == count)
        weights = _centroids(int(count))
        points.append(np.einsum("sk,tkc->tsc", weights, corners[chosen]).reshape(-1, 3))
        triangles.append(np.repeat(chosen, len(weights)))
    if not points:
        return np.zeros((0, 3)), np.zeros(0, int)
    return np.concatenate(points), np.concatenate(triangles)


@functools.cache
def _centroids(parts: int) -> np.ndarray:
    """(parts², 3) barycentric centroids of a triangle's equal parts."""
    i, j = (index.ravel() for index in np.meshgrid(np.arange(parts), np.arange(parts)))
    upright, turned = i + j < parts, i + j < parts - 1
    first = np.concatenate([i[upright] + 1 / 3, i[turned] + 2 / 3]) / parts
    second = np.concatenate([j[upright] + 1 / 3, j[turned] + 2 / 3]) / parts
    return np.column_stack([1.0 - first - second, first, second])

"""Triangles in texture space: which face each texel shows, and where on it.

Texel (row, column) of a square texture has its centre at u = (column + 0.5) / size and
v = (row + 0.5) / size, v downwards as in glTF.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...core.compiled import inlined, kernel, parallel_kernel, prange

_BAND_ROWS = 32
_INSIDE_PX = 1e-3  # a texel this far from a face's edges is inside it


@dataclass(frozen=True)
class TexelMap:
    """``face`` (S, S) int32, -1 for none; ``weights`` (S, S, 3) float32, the barycentric
    weights of the face's corners at the texel's centre or, beside the face, at the point of
    it that is nearest; ``inside`` (S, S) bool, whether the centre is in the face."""

    face: np.ndarray
    weights: np.ndarray
    inside: np.ndarray

    def interpolated(self, values: np.ndarray, faces: np.ndarray) -> np.ndarray:
        """(n, C) float32: per-vertex ``values`` (V, C) at the n texels that show a face, row by row."""
        shown = self.face >= 0
        corners = np.asarray(values, np.float32)[faces[self.face[shown]]]
        return np.einsum("ij,ijk->ik", self.weights[shown], corners)


def texel_map(uvs: np.ndarray, faces: np.ndarray, size_px: int, margin_px: float) -> TexelMap:
    """What the texels of a ``size_px`` square texture show.

    ``uvs`` (V, 2) in [0, 1], ``faces`` (F, 3). Texels up to ``margin_px`` beside a face show
    the nearest face, so that filtering at a chart's border meets its own colours. Of
    faces equally near the lowest index wins.
    """
    corners = np.ascontiguousarray(np.asarray(uvs, np.float64) * size_px)
    face, weights, distance = _nearest(corners, np.ascontiguousarray(faces, np.int32), size_px, margin_px)
    return TexelMap(face, weights, (face >= 0) & (distance == 0))


def overlapping_faces(uvs: np.ndarray, faces: np.ndarray, size_px: int) -> np.ndarray:
    """(F,) bool: the faces that cover a texel's centre which a face before them covers already."""
    corners = np.ascontiguousarray(np.asarray(uvs, np.float64) * size_px)
    return _overlapping(corners, np.ascontiguousarray(faces, np.int32), size_px)


@parallel_kernel
def _nearest(corners, faces, size, margin):
    face = np.full((size, size), -1, np.int32)
    weights = np.zeros((size, size, 3), np.float32)
    distance = np.full((size, size), np.inf, np.float32)
    for band in prange((size + _BAND_ROWS - 1) // _BAND_ROWS):
        for f in range(faces.shape[0]):
            left, right, top, bottom = _bounds(corners, faces, f, margin, size)
            for row in range(max(top, band * _BAND_ROWS), min(bottom, (band + 1) * _BAND_ROWS)):
                for column in range(left, right):
                    _try(corners, faces, f, margin, row, column, face, weights, distance)
    return face, weights, distance


@kernel
def _try(corners, faces, f, margin, row, column, face, weights, distance):
    i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
    x, y = column + 0.5, row + 0.5
    a, b, c, squared = _closest(
        corners[i, 0] - x, corners[i, 1] - y, corners[j, 0] - x, corners[j, 1] - y, corners[k, 0] - x, corners[k, 1] - y
    )
    away = np.float32(np.sqrt(squared))
    if away <= margin and away < distance[row, column]:
        distance[row, column] = away
        face[row, column] = f
        weights[row, column, 0], weights[row, column, 1], weights[row, column, 2] = a, b, c


@inlined
def _bounds(corners, faces, f, margin, size):
    """First and end column, first and end row of the texels within ``margin`` of a face."""
    i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
    left = np.ceil(min(corners[i, 0], corners[j, 0], corners[k, 0]) - margin - 0.5)
    right = np.floor(max(corners[i, 0], corners[j, 0], corners[k, 0]) + margin - 0.5) + 1
    top = np.ceil(min(corners[i, 1], corners[j, 1], corners[k, 1]) - margin - 0.5)
    bottom = np.floor(max(corners[i, 1], corners[j, 1], corners[k, 1]) + margin - 0.5) + 1
    return int(max(left, 0)), int(min(right, size)), int(max(top, 0)), int(min(bottom, size))


@kernel
def _closest(ax, ay, bx, by, cx, cy):
    """The barycentric weights of the triangle's point nearest to the origin, and its square distance."""
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if abs(area) > 1e-12:
        wa, wb, wc = (bx * cy - by * cx) / area, (cx * ay - cy * ax) / area, (ax * by - ay * bx) / area
        if wa >= 0.0 and wb >= 0.0 and wc >= 0.0:
            return wa, wb, wc, 0.0
    t, best = _on_edge(ax, ay, bx, by)
    wa, wb, wc = 1.0 - t, t, 0.0
    t, squared = _on_edge(bx, by, cx, cy)
    if squared < best:
        best = squared
        wa, wb, wc = 0.0, 1.0 - t, t
    t, squared = _on_edge(cx, cy, ax, ay)
    if squared < best:
        best = squared
        wa, wb, wc = t, 0.0, 1.0 - t
    return wa, wb, wc, best


@inlined
def _on_edge(px, py, qx, qy):
    """Where along p to q, in [0, 1], the edge is nearest to the origin, and its square distance there."""
    dx, dy = qx - px, qy - py
    length = dx * dx + dy * dy
    t = 0.0
    if length > 0.0:
        t = min(max(-(px * dx + py * dy) / length, 0.0), 1.0)
    x, y = px + t * dx, py + t * dy
    return t, x * x + y * y


@parallel_kernel
def _overlapping(corners, faces, size):
    taken = np.zeros((size, size), np.bool_)
    lost = np.zeros(faces.shape[0], np.bool_)
    for band in prange((size + _BAND_ROWS - 1) // _BAND_ROWS):
        for f in range(faces.shape[0]):
            left, right, top, bottom = _bounds(corners, faces, f, 0.0, size)
            for row in range(max(top, band * _BAND_ROWS), min(bottom, (band + 1) * _BAND_ROWS)):
                for column in range(left, right):
                    if _well_inside(corners, faces, f, column + 0.5, row + 0.5):
                        if taken[row, column]:
                            lost[f] = True
                        taken[row, column] = True
    return lost


@kernel
def _well_inside(corners, faces, f, x, y):
    i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
    ax, ay = corners[i, 0] - x, corners[i, 1] - y
    bx, by = corners[j, 0] - x, corners[j, 1] - y
    cx, cy = corners[k, 0] - x, corners[k, 1] - y
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    sign = 1.0 if area > 0.0 else -1.0
    a = (bx * cy - by * cx) * sign - _INSIDE_PX * np.sqrt((cx - bx) ** 2 + (cy - by) ** 2)
    b = (cx * ay - cy * ax) * sign - _INSIDE_PX * np.sqrt((ax - cx) ** 2 + (ay - cy) ** 2)
    c = (ax * by - ay * bx) * sign - _INSIDE_PX * np.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
    return a > 0.0 and b > 0.0 and c > 0.0

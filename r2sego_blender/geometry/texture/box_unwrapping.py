"""The unwrapping that always ends: connected faces that look along one axis are a chart.

A chart is projected along its axis. Faces that would cover others of their chart become
charts of their own, in the end single triangles, so no two faces share a texel. Charts
are packed in shelves, as large as they fit.
"""

from __future__ import annotations

import numpy as np

from ...core.errors import GeometryError
from ..mesh.meshes import connected, normals_and_areas
from .texels import overlapping_faces

_ROUNDS = 4  # in which covering faces stay together; later each becomes a chart, so there is an end
_BISECTIONS = 24


def box_unwrapped(
    vertices: np.ndarray, faces: np.ndarray, size_px: int, padding_px: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (V, 3) split where charts part, faces (F, 3) int32 and uvs (V, 2) float32.

    Raises GeometryError when there are more charts than a texture of ``size_px`` holds.
    """
    normals, _ = normals_and_areas(vertices, faces)
    axis = np.abs(normals).argmax(1)
    direction = 2 * axis + (np.take_along_axis(normals, axis[:, None], 1)[:, 0] > 0)
    chart = _components(faces, direction)
    taken_out = 0
    while True:
        split = _laid_out(vertices, faces, axis, chart, size_px, padding_px)
        covering = overlapping_faces(split[2], split[1], size_px)
        if not covering.any():
            return split
        together = taken_out < _ROUNDS
        taken_out += 1
        apart = _components(faces[covering], direction[covering]) if together else np.arange(covering.sum())
        chart[covering] = chart.max() + 1 + apart
        chart = np.unique(chart, return_inverse=True)[1].ravel()


def _components(faces: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """(F,) number of the connected faces of one direction that each face belongs to."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    face = np.repeat(np.arange(len(faces)), 3)
    key = np.unique(np.column_stack([edges, direction[face]]), axis=0, return_inverse=True)[1].ravel()
    edge = len(faces) + key  # faces and their edges are the vertices of one graph
    return connected(np.column_stack([face, edge]), int(edge.max()) + 1)[: len(faces)]


def _laid_out(
    vertices: np.ndarray, faces: np.ndarray, axis: np.ndarray, chart: np.ndarray, size_px: int, padding_px: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Every chart projected and packed: (vertices, faces, uvs)."""
    corners = np.column_stack([np.repeat(chart, 3), faces.ravel()])
    split, index = np.unique(corners, axis=0, return_inverse=True)
    new_faces = index.reshape(-1, 3).astype(np.int32)
    count = int(chart.max()) + 1
    axis_of = np.zeros(count, np.int64)
    axis_of[chart] = axis
    kept = np.array([[1, 2], [2, 0], [0, 1]])[axis_of[split[:, 0]]]
    flat = np.take_along_axis(vertices[split[:, 1]].astype(np.float64), kept, axis=1)
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    np.minimum.at(low, split[:, 0], flat)
    np.maximum.at(high, split[:, 0], flat)
    flat -= low[split[:, 0]]
    scale, origins = _packed(high - low, size_px, padding_px)
    uvs = (flat * scale + origins[split[:, 0]]) / size_px
    return vertices[split[:, 1]], new_faces, np.clip(uvs, 0.0, 1.0).astype(np.float32)


def _packed(extents: np.ndarray, size_px: int, padding_px: int) -> tuple[float, np.ndarray]:
    """Texels per metre, the most that fits, and each chart's first column and row, texels."""
    longest = float(extents.max())
    low, best = 0.0, _shelves(extents, 0.0, size_px, padding_px)
    if best is None:
        raise GeometryError(
            f"{len(extents)} charts do not fit on {size_px}x{size_px} texels",
            where="texture",
            cure="Raise texture.size_px, or lower texture.faces.",
        )
    high = (size_px - 2 * padding_px) / longest
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        origins = _shelves(extents, middle, size_px, padding_px)
        if origins is None:
            high = middle
        else:
            low, best = middle, origins
    return low, best


def _shelves(extents: np.ndarray, scale: float, size_px: int, padding_px: int) -> np.ndarray | None:
    """(C, 2) origins of charts set in rows, the highest first, or None when they do not fit."""
    sizes = np.ceil(extents * scale) + 2 * padding_px
    order = np.lexsort((-sizes[:, 0], -sizes[:, 1]))
    origins = np.zeros_like(sizes)
    x = y = height = 0.0
    for index, (width, high) in zip(order.tolist(), sizes[order].tolist(), strict=True):
        if x + width > size_px:
            x, y, height = 0.0, y + height, 0.0
        if y + high > size_px or width > size_px:
            return None
        origins[index] = x, y
        x, height = x + width, max(height, high)
    return origins + padding_px

"""Small holes in a surface closed, for meshes that are looked at."""

from __future__ import annotations

import numpy as np

from .meshes import connected

_LARGE_PART = 1000
"""Faces that hang together; the rim of a smaller part is taken for its outline, not for a hole."""


def small_holes_closed(vertices: np.ndarray, faces: np.ndarray, longest_rim_m: float) -> tuple[np.ndarray, np.ndarray]:
    """The surface with a fan of triangles in each hole whose rim is shorter than ``longest_rim_m``.

    ``vertices`` (V, 3) metres and ``faces`` (F, 3) come first in what is returned; a hole's triangles
    meet in the middle of its rim and face as its neighbours do. Holes that touch count as one.
    """
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    count = len(vertices)
    rim = edges[~np.isin(edges[:, 0] * count + edges[:, 1], edges[:, 1] * count + edges[:, 0])]
    if not len(rim):
        return vertices, faces
    hole_of = connected(rim, count)[rim[:, 0]]
    part_of = connected(faces, count)
    large = np.bincount(part_of[faces[:, 0]], minlength=part_of.max() + 1) >= _LARGE_PART
    lengths = np.linalg.norm(vertices[rim[:, 0]] - vertices[rim[:, 1]], axis=1)
    rim_m = np.bincount(hole_of, lengths)
    closed = large[part_of[rim[:, 0]]] & (rim_m[hole_of] < longest_rim_m)
    rim, hole = rim[closed], np.unique(hole_of[closed], return_inverse=True)[1]
    around = np.bincount(hole)
    middles = [np.bincount(hole, vertices[rim[:, 0], axis]) / around for axis in range(3)]
    fans = np.column_stack([rim[:, 1], rim[:, 0], count + hole])
    return (
        np.concatenate([vertices, np.column_stack(middles).astype(vertices.dtype)]),
        np.concatenate([faces, fans.astype(faces.dtype)]),
    )

"""Closed rooms and level surfaces as meshes, and meshes as proxies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from r2sego_blender.geometry.proxy.proxy import GeometryProxy


def closed_room(size_m: Sequence[float], *boxes: tuple[ArrayLike, ArrayLike]) -> trimesh.Trimesh:
    """A room on the floor around the origin with boxes (lowest, highest corner); faces face free space."""
    shell = trimesh.creation.box(size_m)
    shell.apply_translation((0, 0, size_m[2] / 2))
    shell.invert()
    return trimesh.util.concatenate([shell, *(trimesh.creation.box(bounds=box) for box in boxes)])


def plate(width: float, depth: float, z: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A rectangle from the origin, level, as two triangles."""
    corners = np.array([[0, 0, z], [width, 0, z], [width, depth, z], [0, depth, z]], float)
    return corners, np.array([[0, 1, 2], [0, 2, 3]])


def grid_faces(rows: int, columns: int) -> np.ndarray:
    """(F, 3) two triangles between each four neighbours of vertices that lie in rows, which face up where these
    go along x and columns along y."""
    number = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)


def observed_proxy(vertices: ArrayLike, faces: ArrayLike, support: ArrayLike = 1) -> GeometryProxy:
    """Vertices (V, 3) and faces (F, 3) as a proxy that ``support`` captures observed, with all confidence."""
    count = len(faces)
    return GeometryProxy(
        np.asarray(vertices, np.float32),
        np.asarray(faces, np.int32),
        np.zeros(count, np.uint8),
        np.broadcast_to(support, count).astype(np.uint16),
        np.ones(count, np.float32),
    )

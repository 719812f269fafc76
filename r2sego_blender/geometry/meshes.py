"""What many modules ask of a triangle mesh: normals, areas, vertices that become one."""

from __future__ import annotations

import numpy as np


def normals_and_areas(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals (F, 3) float64, zero for faces without area, and areas (F,)."""
    a, b, c = (np.asarray(vertices[faces[:, k]], np.float64) for k in range(3))
    cross = np.cross(b - a, c - a)
    length = np.linalg.norm(cross, axis=1)
    return cross / np.maximum(length, 1e-300)[:, None], length / 2


def merged(vertices: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) of the same cell (V, 3) int64 as their mean, and what each became (V,)."""
    _, cluster = np.unique(cells, axis=0, return_inverse=True)
    cluster = cluster.ravel()
    count = np.bincount(cluster)
    return np.stack([np.bincount(cluster, weights=vertices[:, k]) / count for k in range(3)], 1), cluster

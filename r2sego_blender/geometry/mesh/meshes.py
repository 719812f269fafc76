"""What many modules ask of a triangle mesh: normals, areas, parts, vertices that become one."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

_SAME_PLACE_M = 1e-4


def normals_and_areas(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals (F, 3) float64, zero for faces without area, and areas (F,)."""
    a, b, c = (np.asarray(vertices[faces[:, k]], np.float64) for k in range(3))
    cross = np.cross(b - a, c - a)
    length = np.linalg.norm(cross, axis=1)
    return cross / np.maximum(length, 1e-300)[:, None], length / 2


def component_areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(F,) the area of the connected part that each face belongs to."""
    pairs = faces[:, [0, 1, 1, 2]].reshape(-1, 2)
    count = len(vertices)
    graph = coo_matrix((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), (count, count))
    component = connected_components(graph, directed=False)[1][faces[:, 0]]
    return np.bincount(component, weights=normals_and_areas(vertices, faces)[1])[component]


def places(vertices: np.ndarray) -> np.ndarray:
    """(V, 3) int64: the nearest tenths of a millimetre; vertices (V, 3), metres, that share them are one."""
    return np.rint(vertices / _SAME_PLACE_M).astype(np.int64)


def merged(vertices: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) of the same cell (V, 3) int64 as their mean, and what each became (V,)."""
    _, cluster = np.unique(cells, axis=0, return_inverse=True)
    cluster = cluster.ravel()
    count = np.bincount(cluster)
    return np.stack([np.bincount(cluster, weights=vertices[:, k]) / count for k in range(3)], 1), cluster

"""What many modules ask of a triangle mesh: soundness, normals, areas, connected parts, vertices that go or merge."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ...core.errors import GeometryError

_SAME_PLACE_M = 1e-4


def require_sound(vertices: np.ndarray, faces: np.ndarray, cure: str = "Repair the mesh.", what: str = "mesh") -> None:
    """Raises GeometryError where ``vertices`` (V, 3) are not finite, or ``faces`` (F, 3) name others than these."""
    if not np.isfinite(vertices).all():
        raise GeometryError(f"the {what} has vertices that are not finite", cure=cure)
    if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):
        raise GeometryError(f"the {what} has faces without vertices", cure=cure)


def normals_and_areas(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals (F, 3) float64, zero for faces without area, and areas (F,)."""
    a, b, c = (np.asarray(vertices[faces[:, k]], np.float64) for k in range(3))
    cross = np.cross(b - a, c - a)
    length = np.linalg.norm(cross, axis=1)
    return cross / np.maximum(length, 1e-300)[:, None], length / 2


def connected(faces: np.ndarray, count: int) -> np.ndarray:
    """(count,) int32 number of the connected part that each vertex belongs to, in the order of their
    first vertices, as ``faces`` (F, 3), or edges (F, 2), join them; a vertex of none is a part.

    trimesh has the same behind an import that child processes would wait for.
    """
    ends = (faces[:, :-1].ravel(), faces[:, 1:].ravel())
    graph = coo_matrix((np.ones(len(ends[0]), bool), ends), (count, count))
    return connected_components(graph, directed=False)[1]


def component_areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(F,) the area of the connected part that each face belongs to."""
    component = connected(faces, len(vertices))[faces[:, 0]]
    return np.bincount(component, weights=normals_and_areas(vertices, faces)[1])[component]


def compacted(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of ``vertices`` (V, ...) those that ``faces`` (F, 3) have, in their order, and the faces by their new
    numbers, int32."""
    used = np.zeros(len(vertices), bool)
    used[faces] = True
    return vertices[used], (np.cumsum(used, dtype=np.int32) - 1).take(faces)


def places(vertices: np.ndarray) -> np.ndarray:
    """(V, 3) int64: the nearest tenths of a millimetre; vertices (V, 3), metres, that share them are one."""
    return np.rint(vertices / _SAME_PLACE_M).astype(np.int64)


def merged(vertices: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) of the same cell (V, 3) int64 as their mean, and what each became (V,)."""
    _, cluster = np.unique(cells, axis=0, return_inverse=True)
    cluster = cluster.ravel()
    count = np.bincount(cluster)
    return np.stack([np.bincount(cluster, weights=vertices[:, k]) / count for k in range(3)], 1), cluster

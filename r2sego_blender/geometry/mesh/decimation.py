"""Decimation of a triangle mesh by quadric edge collapse (Garland and Heckbert, 1997)."""

from __future__ import annotations

import fast_simplification
import numpy as np

from ...core.errors import GeometryError
from .meshes import compacted, require_sound

_WELD_M = 1e-4  # vertices this near are one
_BORDERS_KEPT_ABOVE = 2  # times the faces asked for


def decimated(vertices: np.ndarray, faces: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
    """The mesh with about ``most`` faces at most: vertices (V, 3) float32, faces (F, 3) int32.

    Vertices in one place are welded first, so that edges between patches can collapse; faces
    without area go. Flat parts lose most faces; open borders are left alone at first, since
    cracks open where patches that only touch move apart. Raises GeometryError for a mesh
    without faces, with indices out of range or with vertices that are not finite.
    """
    vertices, faces = welded(vertices, faces)
    for target, keep_border in ((_BORDERS_KEPT_ABOVE * most, True), (most, False)):
        if len(faces) > target:
            vertices, faces = fast_simplification.simplify(
                vertices, faces, target_count=target, preserve_border=keep_border
            )
            vertices, faces = welded(vertices, faces)
    return vertices, faces


def welded(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same surface with one vertex a place, and without faces that have no area."""
    vertices = np.asarray(vertices, np.float32).reshape(-1, 3)
    faces = np.asarray(faces, np.int64).reshape(-1, 3)
    require_sound(vertices, faces)
    places = np.floor(vertices.astype(np.float64) / _WELD_M + 0.5).astype(np.int64)
    _, first, place = np.unique(places, axis=0, return_index=True, return_inverse=True)
    vertices, faces = vertices[first], place.ravel()[faces]
    corners = vertices[faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    faces = faces[area > 1e-12]
    if not len(faces):
        raise GeometryError("the mesh has no faces", cure="Give a mesh with a surface.")
    return compacted(vertices, faces)

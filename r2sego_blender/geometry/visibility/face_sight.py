"""How well cameras see the faces of a mesh: at which angle, and how finely."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.cameras import Camera
from ..mesh.meshes import normals_and_areas
from .point_visibility import looked_up, same_depth
from .rasterizer import MeshRasterizer

STEEP = 0.3
"""Cosine from which a camera sees a face well: below it a pixel is far from its neighbours, and
what a depth map has there may as well lie elsewhere."""

_SAME_SURFACE = 0.03
"""Relative depth within which a camera sees a face."""


class FaceSight(NamedTuple):
    """The best that any of some cameras does at each face; 0 where none sees its free side.

    ``cosine`` (F,) float64 between the face's normal and the direction to the camera; ``density``
    (F,) float64 pixels of its image on a square metre of the face.
    """

    cosine: np.ndarray
    density: np.ndarray


def face_sight(vertices: np.ndarray, faces: np.ndarray, cameras: Sequence[Camera]) -> FaceSight:
    """How well the ``cameras`` see each of ``faces`` (F, 3), by its middle, of ``vertices`` (V, 3) in metres.

    Raises GeometryError for a mesh that cannot be drawn.
    """
    rasterizer = MeshRasterizer(vertices, faces)
    middles = np.asarray(vertices, np.float64)[faces].mean(axis=1)
    normals, _ = normals_and_areas(vertices, faces)
    best = FaceSight(np.zeros(len(middles)), np.zeros(len(middles)))
    for camera in cameras:
        inside, z, shown = looked_up(middles, camera, rasterizer.render(camera).depth)
        seen = np.flatnonzero(inside)[same_depth(shown, z, _SAME_SURFACE)]
        z = z[same_depth(shown, z, _SAME_SURFACE)]
        towards = camera.centre - middles[seen]
        distance = np.linalg.norm(towards, axis=1)
        cosine = np.maximum((normals[seen] * towards).sum(axis=1) / distance, 0.0)
        # A square metre fills cos d / z^3 of the image plane at focal length 1.
        density = camera.fx * camera.fy * cosine * distance / z**3
        best.cosine[seen] = np.maximum(best.cosine[seen], cosine)
        best.density[seen] = np.maximum(best.density[seen], density)
    return best

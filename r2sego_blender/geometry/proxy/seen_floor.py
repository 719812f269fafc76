"""The part of the floor that the captures vouch for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ...core.cameras import Camera
from ...core.errors import GeometryError
from .proxy import GeometryProxy

_FLOOR_M = 0.05
_LEVEL = 0.9  # cosine between a floor face's normal and up


def seen_floor(proxy: GeometryProxy, cameras: Sequence[Camera]) -> np.ndarray:
    """Corners (n, 2) float64 of the convex outline, metres, of where people and robots can be.

    It holds the floor faces that some capture saw and the places the captures were taken
    from: beyond it the room may end, and the proxy's floor there is only continued. Raises
    GeometryError when the captures saw no floor and were taken along a line.
    """
    corners = proxy.vertices[proxy.faces].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    level = normals[:, 2] > _LEVEL * np.linalg.norm(normals, axis=1)
    low = np.abs(corners[:, :, 2]).max(axis=1) < _FLOOR_M
    seen = corners[level & low & (proxy.support > 0)].reshape(-1, 3)[:, :2]
    places = np.concatenate([seen, [camera.centre[:2] for camera in cameras]])
    try:
        return places[ConvexHull(places).vertices]
    except (QhullError, ValueError) as error:
        raise GeometryError(
            "the captures saw no floor",
            where="geometry proxy",
            cure="Photograph the floor too, or say where the robot may be (`r2sego robot --region`, in "
            "Blender Draw Region).",
        ) from error

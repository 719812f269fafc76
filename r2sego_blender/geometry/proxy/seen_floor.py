"""The part of the floor that the captures vouch for."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from scipy import ndimage
from scipy.spatial import ConvexHull, QhullError
from skimage.measure import find_contours

from ...core.cameras import Camera
from ...core.errors import GeometryError
from ..visibility.face_sight import STEEP, face_sight
from .proxy import GeometryProxy

_FLOOR_M = 0.05
_LEVEL = 0.9  # cosine between a floor face's normal and up
_VOUCHED = 0.3  # confidence: above it is what a capture's stereo lies on, or the planes that two chose
_CELL_M = 0.05
_STOOD_M = 0.5  # around a place from which a person photographed
_BRIDGED_M = 0.5  # floor this near on both sides is floor: between lies what was hidden or has no texture
_SMALLEST_M2 = 3.0  # in less a robot hardly takes a step
_SUBPIXEL = 8  # bits of OpenCV's fixed-point corners


def seen_floor(proxy: GeometryProxy, cameras: Sequence[Camera]) -> np.ndarray:
    """Corners (n, 2) float64 of the outline, metres, of where people and robots can be.

    It holds the floor that some capture looked down on and its depth vouches for, what lies
    closely between, and the places the captures were taken from; of several pieces the one with
    most such floor. Where that is next to nothing, it is the convex outline of all of these.
    Beyond, the room may end or be full of things: the proxy's floor there is
    only continued, as far as the horizon where no wall ends it. Raises GeometryError when the
    captures saw no floor and were taken along a line.
    """
    stood = np.array([camera.centre[:2] for camera in cameras]).reshape(-1, 2)
    triangles = _vouched_for(proxy, cameras)
    points = np.concatenate([triangles.reshape(-1, 2), stood])
    if not len(triangles):
        return _hull(points)
    origin = points.min(axis=0) - max(_STOOD_M, _BRIDGED_M) - 2 * _CELL_M
    columns, rows = np.ceil((points.max(axis=0) - origin + max(_STOOD_M, _BRIDGED_M)) / _CELL_M).astype(int) + 3
    drawn = np.zeros((rows, columns), np.uint8)
    for corners in np.rint((triangles - origin) / _CELL_M * 2**_SUBPIXEL).astype(np.int32):
        cv2.fillConvexPoly(drawn, corners, (1,), shift=_SUBPIXEL)
    x, y = np.meshgrid(np.arange(columns), np.arange(rows))
    cells = origin + _CELL_M * np.stack([x, y], axis=-1)
    floor = drawn > 0
    for place in stood:
        floor |= np.linalg.norm(cells - place, axis=-1) <= _STOOD_M
    near = ndimage.distance_transform_edt(~floor) * _CELL_M <= _BRIDGED_M
    closed = floor | (ndimage.distance_transform_edt(near) * _CELL_M > _BRIDGED_M)
    pieces, count = ndimage.label(closed)
    vouched = ndimage.sum_labels(drawn, pieces, np.arange(1, count + 1))
    piece = ndimage.binary_fill_holes(pieces == 1 + np.argmax(vouched))
    if piece.sum() * _CELL_M**2 < _SMALLEST_M2:
        return _hull(points)
    from skimage.measure import approximate_polygon  # its module imports scipy.signal: most of a command's start

    outline = max(find_contours(piece.astype(np.float64), 0.5), key=len)
    return origin + _CELL_M * approximate_polygon(outline, 1.0)[:-1, ::-1]


def _vouched_for(proxy: GeometryProxy, cameras: Sequence[Camera]) -> np.ndarray:
    """(T, 3, 2) corners of the floor faces that captures vouch for."""
    corners = proxy.vertices[proxy.faces].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    level = normals[:, 2] > _LEVEL * np.linalg.norm(normals, axis=1)
    low = np.abs(corners[:, :, 2]).max(axis=1) < _FLOOR_M
    known = (proxy.support > 0) & (proxy.confidence > _VOUCHED)
    sight = face_sight(proxy.vertices, proxy.faces, cameras)
    return corners[level & low & known & (sight.cosine >= STEEP)][:, :, :2]


def _hull(places: np.ndarray) -> np.ndarray:
    """Corners of the convex outline of places (N, 2)."""
    try:
        return places[ConvexHull(places).vertices]
    except (QhullError, ValueError) as error:
        raise GeometryError(
            "the captures saw no floor",
            where="geometry proxy",
            cure="Photograph the floor too, or say where the robot may be (`r2sego robot --region`, in "
            "Blender Draw Region).",
        ) from error

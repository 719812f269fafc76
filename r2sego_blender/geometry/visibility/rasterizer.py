"""A z-buffer of triangle meshes: planar depth and face index, as exact ray casting gives.

Pixels are tested with homogeneous edge functions (Olano and Greer, 1997): the pixel's ray
r = (x, y, 1) hits the triangle (a, b, c) of the camera frame where (b x c).r, (c x a).r
and (a x b).r all carry the sign of det = a.(b x c), and 1/z is their sum over det. No
vertex is divided by its depth, so triangles that cross the near plane need no new
vertices: their part nearer than the plane is cut off pixel by pixel, exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core.cameras import Camera
from ...core.compiled import inlined, kernel, parallel_kernel, prange
from ..mesh.meshes import require_sound
from .projection import NEAR_M, place, screen_extent

_BAND_ROWS = 16  # rows a thread draws at a time: fine enough to balance two cores
_CHUNK = 4096  # triangles whose bounds a thread computes at a time
_SLACK = 1e-9
"""Faces are drawn wider by this share of their size: the faces around a vertex round each for
itself, and a ray that meets the vertex itself would slip through between all of them."""
_ROUNDING_PX = 1e-6  # bounds are widened by this, so that rounding never loses a pixel


@dataclass(frozen=True)
class MeshBuffers:
    """What a camera sees of a mesh.

    ``depth`` (H, W) float32 planar z in metres, 0 where there is no surface; ``face``
    (H, W) int32 index of the visible face, -1 for none; ``attributes``: for each vertex
    attribute asked for, (H, W, C) float32, interpolated perspective-correctly, 0 for none.
    """

    depth: np.ndarray
    face: np.ndarray
    attributes: tuple[np.ndarray, ...] = ()

    def of_face(self, values: np.ndarray, missing: float = 0) -> np.ndarray:
        """A per-face array (F, ...) looked up at every pixel: (H, W, ...), ``missing`` where none."""
        seen = self.face >= 0
        image = np.full((*self.face.shape, *values.shape[1:]), missing, values.dtype)
        image[seen] = values[self.face[seen]]
        return image


class MeshRasterizer:
    """Draws one triangle mesh from any camera; both sides of a face are visible.

    ``vertices`` (V, 3) metres, ``faces`` (F, 3) indices. Raises GeometryError for indices
    out of range or vertices that are not finite. Faces at the same depth are told apart by
    their index, the lower one wins, so the result does not depend on the number of threads.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        self._vertices = np.ascontiguousarray(vertices, np.float64).reshape(-1, 3)
        self._faces = np.ascontiguousarray(faces, np.int32).reshape(-1, 3)
        require_sound(self._vertices, self._faces)

    def render(self, camera: Camera, attributes: Sequence[np.ndarray] = ()) -> MeshBuffers:
        """The mesh as ``camera`` sees it; ``attributes`` are (V,) or (V, C) per-vertex values."""
        pose = camera.camera_from_world[:3]
        lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
        local, screen = _project(self._vertices, pose, lens)
        bounds = _screen_bounds(local, screen, self._faces, lens, camera.width, camera.height)
        starts, listed = _in_bands(bounds, camera.height)
        inverse, face = _draw(local, self._faces, bounds, starts, listed, lens, camera.width, camera.height)
        interpolated = tuple(
            _interpolate(local, self._faces, face, lens, np.ascontiguousarray(values, np.float32))
            for values in (np.reshape(a, (len(self._vertices), -1)) for a in attributes)
        )
        depth = np.zeros(camera.shape, np.float32)
        np.divide(np.float32(1.0), inverse, out=depth, where=face >= 0)
        return MeshBuffers(depth, face, interpolated)


@parallel_kernel
def _project(vertices, pose, lens):
    """(V, 3) in the camera's frame and (V, 2) pixels, the latter only beyond the near plane."""
    local = np.empty_like(vertices)
    screen = np.empty((vertices.shape[0], 2))
    for i in prange(vertices.shape[0]):
        place(vertices, i, pose, lens, local, screen, i)
    return local, screen


@parallel_kernel
def _screen_bounds(local, screen, faces, lens, width, height):
    """(F, 4) int16: first and end column and row of the pixels a face may cover in front of
    the near plane; an empty range where it covers none."""
    count = faces.shape[0]
    bounds = np.empty((count, 4), np.int16)
    for chunk in prange((count + _CHUNK - 1) // _CHUNK):
        for f in range(chunk * _CHUNK, min(count, (chunk + 1) * _CHUNK)):
            low_u, high_u, low_v, high_v = screen_extent(local, screen, faces[f], lens)
            # Clamped while still floats: a vertex may project millions of pixels away.
            bounds[f, 0] = np.int16(np.ceil(min(max(low_u - 0.5 - _ROUNDING_PX, 0.0), float(width))))
            bounds[f, 1] = np.int16(np.floor(min(max(high_u + 0.5 + _ROUNDING_PX, 0.0), float(width))))
            bounds[f, 2] = np.int16(np.ceil(min(max(low_v - 0.5 - _ROUNDING_PX, 0.0), float(height))))
            bounds[f, 3] = np.int16(np.floor(min(max(high_v + 0.5 + _ROUNDING_PX, 0.0), float(height))))
    return bounds


@kernel
def _in_bands(bounds, height):
    """The faces that each band of rows may show, in order: band b has listed[starts[b]:starts[b + 1]]."""
    starts = np.zeros((height + _BAND_ROWS - 1) // _BAND_ROWS + 1, np.int64)
    for f in range(bounds.shape[0]):
        if bounds[f, 0] < bounds[f, 1] and bounds[f, 2] < bounds[f, 3]:
            for band in range(bounds[f, 2] // _BAND_ROWS, (bounds[f, 3] - 1) // _BAND_ROWS + 1):
                starts[band + 1] += 1
    starts = np.cumsum(starts)
    listed = np.empty(starts[-1], np.int32)
    filled = starts.copy()
    for f in range(bounds.shape[0]):
        if bounds[f, 0] < bounds[f, 1] and bounds[f, 2] < bounds[f, 3]:
            for band in range(bounds[f, 2] // _BAND_ROWS, (bounds[f, 3] - 1) // _BAND_ROWS + 1):
                listed[filled[band]] = f
                filled[band] += 1
    return starts, listed


@inlined
def edge_plane(local, i, j):
    """The normal of the plane through the camera and the edge i-j.

    Taken in the order of the vertex indices, so that the two faces of an edge get exactly
    opposite values and no ray slips through between them.
    """
    a, b, sign = (i, j, 1.0) if i < j else (j, i, -1.0)
    return (
        sign * (local[a, 1] * local[b, 2] - local[a, 2] * local[b, 1]),
        sign * (local[a, 2] * local[b, 0] - local[a, 0] * local[b, 2]),
        sign * (local[a, 0] * local[b, 1] - local[a, 1] * local[b, 0]),
    )


@parallel_kernel
def _draw(local, faces, bounds, starts, listed, lens, width, height):
    """(H, W) float32 inverse depth and (H, W) int32 face of the nearest surface."""
    inverse = np.zeros((height, width), np.float32)
    face = np.full((height, width), -1, np.int32)
    for band in prange((height + _BAND_ROWS - 1) // _BAND_ROWS):
        first, end = band * _BAND_ROWS, min(height, (band + 1) * _BAND_ROWS)
        for k in range(starts[band], starts[band + 1]):
            draw_face(local, faces, bounds, lens, listed[k], first, end, inverse, face)
    return inverse, face


@kernel
def draw_face(local, faces, bounds, lens, f, first, end, inverse, face):
    """Draw face ``f`` into the rows ``first`` to ``end`` of both buffers, where it is the nearest."""
    i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
    ax, ay, az = edge_plane(local, j, k)
    bx, by, bz = edge_plane(local, k, i)
    cx, cy, cz = edge_plane(local, i, j)
    det = local[i, 0] * ax + local[i, 1] * ay + local[i, 2] * az
    if det == 0.0:
        return
    sign = 1.0 if det > 0.0 else -1.0
    ax, ay, az = ax * sign, ay * sign, az * sign
    bx, by, bz = bx * sign, by * sign, bz * sign
    cx, cy, cz = cx * sign, cy * sign, cz * sign
    scale = 1.0 / (det * sign)
    near, far = _inverse_depth_range(local[i, 2], local[j, 2], local[k, 2])
    step_x = 1.0 / lens[0]
    for row in range(max(first, bounds[f, 2]), min(end, bounds[f, 3])):
        y = (row + 0.5 - lens[3]) / lens[1]
        a0, b0, c0 = ay * y + az, by * y + bz, cy * y + cz
        for column in range(bounds[f, 0], bounds[f, 1]):
            x = (column + 0.5 - lens[2]) * step_x
            a, b, c = ax * x + a0, bx * x + b0, cx * x + c0
            least = -_SLACK * (a + b + c)
            if a >= least and b >= least and c >= least:
                # A face seen edge-on is ill-conditioned, but never leaves its corners' range.
                value = np.float32(min(max((a + b + c) * scale, far), near))
                if value <= 1.0 / NEAR_M and value > inverse[row, column]:
                    inverse[row, column] = value
                    face[row, column] = f


@inlined
def _inverse_depth_range(z0, z1, z2):
    low, high = min(z0, z1, z2), max(z0, z1, z2)
    near = 1.0 / low if low > 0.0 else np.inf
    return near, 1.0 / high


@parallel_kernel
def _interpolate(local, faces, face, lens, values):
    height, width = face.shape
    channels = values.shape[1]
    image = np.zeros((height, width, channels), np.float32)
    for row in prange(height):
        y = (row + 0.5 - lens[3]) / lens[1]
        for column in range(width):
            f = face[row, column]
            if f < 0:
                continue
            x = (column + 0.5 - lens[2]) / lens[0]
            i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
            ax, ay, az = edge_plane(local, j, k)
            bx, by, bz = edge_plane(local, k, i)
            cx, cy, cz = edge_plane(local, i, j)
            a, b, c = ax * x + ay * y + az, bx * x + by * y + bz, cx * x + cy * y + cz
            total = a + b + c
            for channel in range(channels):
                image[row, column, channel] = (
                    a * values[i, channel] + b * values[j, channel] + c * values[k, channel]
                ) / total
    return image

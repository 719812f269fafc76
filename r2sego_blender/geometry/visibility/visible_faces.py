"""Which faces of a mesh many views see: kernels of the coverage.

Each view has a z-buffer of few pixels. A face is asked at its middle: its plane's depth at the
pixel's centre against the nearest surface drawn there, so that a floor seen at a low angle
does not hide itself.
"""

from __future__ import annotations

import numpy as np

from ...core.compiled import kernel, parallel_kernel, prange
from .projection import NEAR_M, screen_extent
from .rasterizer import draw_face, edge_plane
from .view_volume import in_view, side_planes

_CLUSTER = 64  # faces that a view skips together
_CELL_M = 0.4  # neighbours in a cell stand in the same clusters
_GROUPS = 16  # views that a thread takes one after the other share their counts
_HIDDEN_BEHIND = 0.02  # relative depth by which a face may lie behind what is drawn
_LEAST_COSINE = 0.03  # seen more edge-on than this, a face's plane says nothing of its depth


def count_views(
    poses: np.ndarray, lens: np.ndarray, width: int, height: int, vertices: np.ndarray, faces: np.ndarray
) -> np.ndarray:
    """(F,) uint32: how many of the ``poses`` (M, 3, 4), camera_from_world, see each of the ``faces``.

    ``lens`` is fx, fy, cx, cy in pixels of the ``width`` x ``height`` images; ``vertices`` (V, 3)
    float64 metres, ``faces`` (F, 3) int32.
    """
    middles = vertices[faces].mean(1)
    cells = np.floor(middles / _CELL_M).astype(np.int64)
    order = np.lexsort((cells[:, 0], cells[:, 1], cells[:, 2]))
    counts = np.empty(len(faces), np.uint32)
    clusters = np.append(np.arange(0, len(faces), _CLUSTER), len(faces))
    counts[order] = _count_views(
        poses, lens, width, height, vertices, faces[order], clusters, _spheres(vertices[faces[order]], clusters)
    )
    return counts


def _spheres(corners: np.ndarray, clusters: np.ndarray) -> np.ndarray:
    """(C, 4): centre and radius around the ``corners`` (F, 3, 3) of each cluster's faces."""
    if not len(corners):
        return np.zeros((0, 4))
    low, high = (f.reduceat(corners, clusters[:-1]) for f in (np.minimum, np.maximum))
    low, high = low.min(1), high.max(1)
    return np.column_stack([(low + high) / 2, np.linalg.norm(high - low, axis=1) / 2])


@parallel_kernel
def _count_views(poses, lens, width, height, vertices, faces, clusters, spheres):
    counts = np.zeros((_GROUPS, faces.shape[0]), np.uint32)
    sides = side_planes(lens, width, height)
    for group in prange(_GROUPS):
        local, screen = np.empty((vertices.shape[0], 3)), np.empty((vertices.shape[0], 2))
        placed = np.full(vertices.shape[0], -1, np.int32)
        bounds = np.zeros((faces.shape[0], 4), np.int16)
        inverse, shown = np.empty((height, width), np.float32), np.empty((height, width), np.int32)
        near, asked = np.empty(faces.shape[0], np.int32), np.full(faces.shape[0], -1, np.int32)
        for view in range(group, poses.shape[0], _GROUPS):
            inverse[:] = 0.0
            shown[:] = -1
            found = 0
            for c in range(spheres.shape[0]):
                if in_view(poses[view], sides, spheres[c]):
                    for f in range(clusters[c], clusters[c + 1]):
                        _place(vertices, faces[f], poses[view], lens, view, placed, local, screen)
                        if _reaches_in(local, screen, faces[f], lens, width, height, bounds[f]):
                            near[found] = f
                            found += 1
            for k in range(found):
                f = near[k]
                if bounds[f, 0] < bounds[f, 1] and bounds[f, 2] < bounds[f, 3]:
                    draw_face(local, faces, bounds, lens, f, 0, height, inverse, shown)
            _count(local, faces, near[:found], lens, inverse, shown, view, asked, counts[group])
    total = np.zeros(faces.shape[0], np.uint32)
    for group in range(_GROUPS):
        total += counts[group]
    return total


@kernel
def _place(vertices, face, pose, lens, view, placed, local, screen):
    """Take the face's vertices to the camera's frame and to pixels, once a view."""
    for corner in range(3):
        i = face[corner]
        if placed[i] == view:
            continue
        placed[i] = view
        # As ``projection.place`` has it: inlined from there, counting takes a third longer.
        for axis in range(3):
            local[i, axis] = (
                pose[axis, 0] * vertices[i, 0]
                + pose[axis, 1] * vertices[i, 1]
                + pose[axis, 2] * vertices[i, 2]
                + pose[axis, 3]
            )
        if local[i, 2] >= NEAR_M:
            inverse = 1.0 / local[i, 2]
            screen[i, 0] = local[i, 0] * inverse * lens[0] + lens[2]
            screen[i, 1] = local[i, 1] * inverse * lens[1] + lens[3]


@kernel
def _reaches_in(local, screen, face, lens, width, height, bounds):
    """Whether a face may reach into the image; ``bounds``: the pixels whose centres it may cover."""
    i, j, k = face[0], face[1], face[2]
    if local[i, 2] < NEAR_M and local[j, 2] < NEAR_M and local[k, 2] < NEAR_M:
        return False
    low_u, high_u, low_v, high_v = screen_extent(local, screen, face, lens)
    if high_u <= 0.0 or low_u >= width or high_v <= 0.0 or low_v >= height:
        return False
    bounds[0] = np.int16(np.ceil(max(low_u - 0.5, 0.0)))
    bounds[1] = np.int16(np.floor(min(high_u + 0.5, float(width))))
    bounds[2] = np.int16(np.ceil(max(low_v - 0.5, 0.0)))
    bounds[3] = np.int16(np.floor(min(high_v + 0.5, float(height))))
    return True


@kernel
def _count(local, faces, near, lens, inverse, shown, view, asked, counts):
    """Add the view to the counts of the faces it sees; ``asked`` is the last view each face knows."""
    height, width = inverse.shape
    for f in near:
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay, az = edge_plane(local, j, k)
        bx, by, bz = edge_plane(local, k, i)
        cx, cy, cz = edge_plane(local, i, j)
        det = local[i, 0] * ax + local[i, 1] * ay + local[i, 2] * az
        if det >= 0.0:  # edge-on, or seen from behind
            asked[f] = view
            continue
        x = (local[i, 0] + local[j, 0] + local[k, 0]) / 3.0
        y = (local[i, 1] + local[j, 1] + local[k, 1]) / 3.0
        z = (local[i, 2] + local[j, 2] + local[k, 2]) / 3.0
        if z < NEAR_M:
            continue
        u, v = x / z * lens[0] + lens[2], y / z * lens[1] + lens[3]
        if not (u >= 0.0 and u < width and v >= 0.0 and v < height):
            continue
        row, column = int(v), int(u)
        nx, ny, nz = ax + bx + cx, ay + by + cy, az + bz + cz
        lengths = (nx * nx + ny * ny + nz * nz) * (x * x + y * y + z * z)
        there = 1.0 / z
        if det * det > (_LEAST_COSINE * _LEAST_COSINE) * lengths:  # n.x is det at each point of the plane
            right, down = (column + 0.5 - lens[2]) / lens[0], (row + 0.5 - lens[3]) / lens[1]
            there = max(there, (nx * right + ny * down + nz) / det)
        if there >= inverse[row, column] * (1.0 - _HIDDEN_BEHIND):
            counts[f] += 1
            asked[f] = view
    for row in range(height):
        for column in range(width):
            f = shown[row, column]
            if f >= 0 and asked[f] != view:
                counts[f] += 1
                asked[f] = view

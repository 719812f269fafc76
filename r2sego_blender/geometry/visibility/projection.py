"""Where points and faces fall on a camera's image: the arithmetic that the kernels share.

``pose`` (3, 4) is camera_from_world, ``lens`` fx, fy, cx, cy in pixels; depth is planar z, metres.
"""

from __future__ import annotations

import numpy as np

from ...core.compiled import inlined, kernel

NEAR_M = 0.02
"""Surfaces nearer to the camera plane than this are not drawn, and say nothing of colours."""


@inlined
def depth_of(pose, x, y, z):
    """The depth of a point of the world."""
    return pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3]


@inlined
def pixel_of(pose, lens, x, y, z, depth):
    """The pixel (u, v) of a point of the world, whose ``depth`` is more than 0."""
    right = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3]
    down = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3]
    return right / depth * lens[0] + lens[2], down / depth * lens[1] + lens[3]


@inlined
def place(vertices, i, pose, lens, local, screen, k):
    """Put vertex ``i`` of a mesh into entry ``k``: ``local`` (K, 3) in the camera's frame and ``screen``
    (K, 2) pixels, the latter only beyond the near plane."""
    for axis in range(3):
        local[k, axis] = (
            pose[axis, 0] * vertices[i, 0]
            + pose[axis, 1] * vertices[i, 1]
            + pose[axis, 2] * vertices[i, 2]
            + pose[axis, 3]
        )
    if local[k, 2] >= NEAR_M:
        inverse = 1.0 / local[k, 2]
        screen[k, 0] = local[k, 0] * inverse * lens[0] + lens[2]
        screen[k, 1] = local[k, 1] * inverse * lens[1] + lens[3]


@kernel
def screen_extent(local, screen, face, lens):
    """Lowest and highest column and row, pixels, of what of a face lies beyond the near plane; inf and
    -inf where nothing does. ``local`` and ``screen`` are as ``place`` fills them."""
    i, j, k = face[0], face[1], face[2]
    if min(local[i, 2], local[j, 2], local[k, 2]) >= NEAR_M:
        return (
            min(screen[i, 0], screen[j, 0], screen[k, 0]),
            max(screen[i, 0], screen[j, 0], screen[k, 0]),
            min(screen[i, 1], screen[j, 1], screen[k, 1]),
            max(screen[i, 1], screen[j, 1], screen[k, 1]),
        )
    low_u = low_v = np.inf
    high_u = high_v = -np.inf
    for corner in range(3):
        a, b = face[corner], face[(corner + 1) % 3]
        za, zb = local[a, 2], local[b, 2]
        if za >= NEAR_M:
            u, v = screen[a, 0], screen[a, 1]
            low_u, high_u, low_v, high_v = min(low_u, u), max(high_u, u), min(low_v, v), max(high_v, v)
        if (za >= NEAR_M) != (zb >= NEAR_M):
            t = (NEAR_M - za) / (zb - za)
            u = (local[a, 0] + t * (local[b, 0] - local[a, 0])) / NEAR_M * lens[0] + lens[2]
            v = (local[a, 1] + t * (local[b, 1] - local[a, 1])) / NEAR_M * lens[1] + lens[3]
            low_u, high_u, low_v, high_v = min(low_u, u), max(high_u, u), min(low_v, v), max(high_v, v)
    return low_u, high_u, low_v, high_v

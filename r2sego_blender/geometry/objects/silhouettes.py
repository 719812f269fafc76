"""Silhouettes of a shape against the masks of its object: kernels of the alignment.

A view is a window of a capture: its mask, and the depth known in it. The shape is drawn
into the window's own depth buffer, and each pixel says what it thinks of the pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.cameras import Camera
from ...core.compiled import kernel

NEAREST_SHAPE_M = 0.05
"""Faces that reach nearer to the camera plane than this are not drawn."""

HIDING_M = 0.08
"""Known depth that is this much nearer than the shape may hide it; so much farther, it is free."""

BOTH, MASK_ONLY, SHAPE_ONLY, FREE = range(4)
"""Pixels of mask and shape, of the mask alone, of the shape alone where nothing is known to
stand before it, and those of the last where the depth behind is known: free space."""

WIDER, DRAWN, NARROWER = range(3)
"""A mask as it was drawn, and a pixel wider and narrower: people and networks draw the whole
outline a little too far out or in."""


class MaskViews(NamedTuple):
    """Windows of the captures that know of an object, one after the other in flat arrays.

    ``masks`` uint8, how many of WIDER, DRAWN and NARROWER a pixel lies in, and ``depths``
    float32 metres (0 = unknown) hold V windows of ``sizes`` (V, 2) rows and columns from
    ``starts`` (V,); ``poses`` (V, 3, 4) are camera_from_world; ``lenses`` (V, 4) fx, fy, cx,
    cy in the window's pixels.
    """

    masks: np.ndarray
    depths: np.ndarray
    sizes: np.ndarray
    starts: np.ndarray
    poses: np.ndarray
    lenses: np.ndarray

    @staticmethod
    def of(cameras: Sequence[Camera], masks: Sequence[np.ndarray], depths: Sequence[np.ndarray]) -> MaskViews:
        """From each window's camera, mask (H, W) uint8 and depth (H, W)."""
        sizes = np.array([camera.shape for camera in cameras], np.int64).reshape(-1, 2)
        starts = np.concatenate([[0], np.cumsum(sizes.prod(1))])[:-1].astype(np.int64)
        lenses = np.array([[c.fx, c.fy, c.cx, c.cy] for c in cameras], np.float64).reshape(-1, 4)
        poses = np.array([c.camera_from_world[:3] for c in cameras]).reshape(-1, 3, 4)
        flat = [np.concatenate([np.ravel(image) for image in images]) for images in (masks, depths)]
        return MaskViews(flat[0].astype(np.uint8), flat[1].astype(np.float32), sizes, starts, poses, lenses)


@kernel
def scratch(sizes, vertices):
    """What ``count_pixels`` works on: the vertices in a view, and its inverse depths."""
    pixels = 0
    for v in range(sizes.shape[0]):
        pixels = max(pixels, sizes[v, 0] * sizes[v, 1])
    return np.empty((vertices, 3)), np.empty(pixels, np.float32)


@kernel
def count_pixels(views, linear, place, vertices, faces, local, buffer, counts):
    """Pixels that are BOTH, MASK_ONLY, SHAPE_ONLY and FREE, for the WIDER, DRAWN and NARROWER mask of
    each view, into ``counts`` (V, 3, 4) int64.

    The shape is ``vertices`` (n, 3) float64 after x -> ``linear`` x + ``place``, in the world, and
    ``faces`` (F, 3). What it covers outside the mask does not count where known depth is nearer:
    there it may be hidden.
    """
    for v in range(views.sizes.shape[0]):
        height, width = views.sizes[v]
        pixels = height * width
        buffer[:pixels] = 0.0
        pose, lens = views.poses[v], views.lenses[v]
        rotation = np.ascontiguousarray(pose[:, :3])
        turn, shift = rotation @ linear, rotation @ place + pose[:, 3]
        for i in range(vertices.shape[0]):
            x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
            depth = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z + shift[2]
            if depth < NEAREST_SHAPE_M:
                local[i, 2] = -1.0
                continue
            inverse = 1.0 / depth
            right = turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z + shift[0]
            down = turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z + shift[1]
            local[i, 0] = right * inverse * lens[0] + lens[2]
            local[i, 1] = down * inverse * lens[1] + lens[3]
            local[i, 2] = inverse
        for f in range(faces.shape[0]):
            _draw(local, faces[f, 0], faces[f, 1], faces[f, 2], width, height, buffer)
        start = views.starts[v]
        _count(buffer[:pixels], views.masks[start : start + pixels], views.depths[start : start + pixels], counts[v])


@kernel
def _count(inverses, masks, depths, counts):
    margin = np.float32(HIDING_M)
    for width in range(3):
        both, mask_only, shape_only, free = np.int32(0), np.int32(0), np.int32(0), np.int32(0)
        for p in range(inverses.shape[0]):
            inverse, known, mask = inverses[p], depths[p], masks[p] > width
            drawn = inverse > np.float32(0.0)
            # known - 1 / inverse, the depth behind the shape, times inverse
            behind = known * inverse - np.float32(1.0)
            unknown = known == np.float32(0.0)
            both += np.int32(drawn & mask)
            mask_only += np.int32(mask & (not drawn))
            shape_only += np.int32(drawn & (not mask) & (unknown | (behind > -margin * inverse)))
            free += np.int32(drawn & (not mask) & (behind > margin * inverse))
        counts[width, BOTH], counts[width, MASK_ONLY] = both, mask_only
        counts[width, SHAPE_ONLY], counts[width, FREE] = shape_only, free


@kernel
def _draw(local, i, j, k, width, height, buffer):
    """One face into the buffer of inverse depths; both sides are visible."""
    if local[i, 2] <= 0.0 or local[j, 2] <= 0.0 or local[k, 2] <= 0.0:
        return
    ax, ay, bx, by, cx, cy = local[i, 0], local[i, 1], local[j, 0], local[j, 1], local[k, 0], local[k, 1]
    low_x, high_x = min(ax, bx, cx) - 0.5, max(ax, bx, cx) - 0.5
    low_y, high_y = min(ay, by, cy) - 0.5, max(ay, by, cy) - 0.5
    if high_x < 0.0 or high_y < 0.0 or low_x > width - 1.0 or low_y > height - 1.0:
        return
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if abs(area) < 1e-9:
        return
    # The corners' weights and the inverse depth are linear in the pixel; where all weights
    # are positive is one run of pixels a row.
    per_area = 1.0 / area
    u_x, u_y = (by - cy) * per_area, (cx - bx) * per_area
    v_x, v_y = (cy - ay) * per_area, (ax - cx) * per_area
    w_x, w_y = -u_x - v_x, -u_y - v_y
    za, zb, zc = local[i, 2], local[j, 2], local[k, 2]
    step = np.float32(u_x * za + v_x * zb + w_x * zc)
    first_x, last_x = np.ceil(max(low_x, 0.0)), np.floor(min(high_x, width - 1.0))
    first_y, last_y = int(np.ceil(max(low_y, 0.0))), int(np.floor(min(high_y, height - 1.0)))
    for y in range(first_y, last_y + 1):
        from_c_y = y + 0.5 - cy
        u, v = u_y * from_c_y + u_x * (0.5 - cx), v_y * from_c_y + v_x * (0.5 - cx)
        w = 1.0 + w_y * from_c_y + w_x * (0.5 - cx)
        low, high = _run(u, u_x, first_x, last_x)
        low, high = _run(v, v_x, low, high)
        low, high = _run(w, w_x, low, high)
        start, stop = int(np.ceil(low)), int(np.floor(high)) + 1
        inverse = np.float32(u * za + v * zb + w * zc)
        row = buffer[y * width : (y + 1) * width]
        for x in range(start, stop):
            row[x] = max(row[x], inverse + step * np.float32(x))


@kernel
def _run(value, slope, low, high):
    """The part of low..high where ``value + slope x`` is not negative."""
    if slope > 0.0:
        return max(low, -value / slope), high
    if slope < 0.0:
        return low, min(high, -value / slope)
    return low, high if value >= 0.0 else low - 1.0

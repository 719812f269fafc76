"""Depth aligned to the image's edges by a colour-weighted mode over nearby surfaces.

Window matching fattens things: background next to a silhouette takes the depth of what
stands before it. Here each pixel asks its neighbours of similar colour, each answering
with its own tangent plane extended to the pixel; the depth most of them agree on wins.
"""

from __future__ import annotations

import numpy as np

from ...core.cameras import Camera
from ...core.compiled import parallel_kernel, prange

_RADIUS_PX = 9  # wider than the matching window that blurs the edges
_COLOUR_SIGMA = 0.05
_NEGLIGIBLE = -7.0  # exponent of a vote that does not count
_LOG_BIN = 0.02  # depths within this share count as one surface
_NEAREST_M, _FARTHEST_M = 0.1, 100.0
_BINS = int(np.log(_FARTHEST_M / _NEAREST_M) / _LOG_BIN) + 3


def aligned_to_edges(
    image: np.ndarray, depth: np.ndarray, normal: np.ndarray, camera: Camera
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What the neighbours of each pixel say about its depth.

    ``image`` (H, W, 3) float32, ``depth`` (H, W) planar metres (0 = unknown), ``normal``
    (H, W, 3) in the world. Returns ``mode`` (H, W) float32, the depth they favour (0 where
    there are none), ``votes`` (H, W) its weight as a share of a full window's, and ``own``
    (H, W) the weight of those that agree with the pixel's present depth.
    """
    rays = camera.rays()
    local = np.asarray(normal, np.float64) @ camera.world_from_camera[:3, :3]
    facing = np.einsum("ijk,ijk->ij", local, rays)
    usable = (depth > 0) & (facing < -0.05)  # the tangent plane of a grazing surface is noise
    scale = np.where(usable, 1.0 / np.where(usable, depth * facing, 1.0), 0.0)
    planes = np.ascontiguousarray(local * scale[..., None], np.float32)
    return _mode(
        np.ascontiguousarray(image, np.float32),
        np.ascontiguousarray(depth, np.float32),
        planes,
        rays.astype(np.float32),
        _RADIUS_PX,
    )


@parallel_kernel
def _mode(image, depth, planes, rays, radius):
    height, width = depth.shape
    mode = np.zeros((height, width), np.float32)
    votes = np.zeros((height, width), np.float32)
    own = np.zeros((height, width), np.float32)
    colour_scale = -0.5 / (_COLOUR_SIGMA * _COLOUR_SIGMA)
    space_scale = -0.5 / (0.6 * radius) ** 2
    full = 0.0
    for y in range(-radius, radius + 1):
        for x in range(-radius, radius + 1):
            full += np.exp(space_scale * (y * y + x * x))
    for row in prange(height):
        mass = np.zeros(_BINS)
        total = np.zeros(_BINS)
        for column in range(width):
            mass[:] = 0.0
            total[:] = 0.0
            for y in range(max(0, row - radius), min(height, row + radius + 1)):
                for x in range(max(0, column - radius), min(width, column + radius + 1)):
                    d = depth[y, x]
                    if d <= 0.0:
                        continue
                    difference = 0.0
                    for channel in range(3):
                        step = image[y, x, channel] - image[row, column, channel]
                        difference += step * step
                    away = (y - row) * (y - row) + (x - column) * (x - column)
                    exponent = colour_scale * difference + space_scale * away
                    if exponent < _NEGLIGIBLE:
                        continue
                    inverse = (
                        planes[y, x, 0] * rays[row, column, 0]
                        + planes[y, x, 1] * rays[row, column, 1]
                        + planes[y, x, 2]
                    )
                    # A plane that runs away within the window is not this pixel's surface.
                    ratio = inverse * d
                    if not (0.8 < ratio < 1.25):
                        continue
                    log_depth = -np.log(inverse)
                    place = (log_depth - np.log(_NEAREST_M)) / _LOG_BIN
                    if not (0.0 <= place < _BINS - 2):
                        continue
                    weight = np.exp(exponent)
                    mass[int(place) + 1] += weight
                    total[int(place) + 1] += weight * log_depth
            best, at = 0.0, 0
            for b in range(1, _BINS - 1):
                here = mass[b - 1] + mass[b] + mass[b + 1]
                if here > best:
                    best, at = here, b
            if at == 0:
                continue
            mean = (total[at - 1] + total[at] + total[at + 1]) / best
            mode[row, column] = np.exp(mean)
            votes[row, column] = best / full
            if depth[row, column] > 0.0:
                place = (np.log(depth[row, column]) - np.log(_NEAREST_M)) / _LOG_BIN
                if 0.0 <= place < _BINS - 2:
                    b = int(place) + 1
                    own[row, column] = (mass[b - 1] + mass[b] + mass[b + 1]) / full
    return mode, votes, own

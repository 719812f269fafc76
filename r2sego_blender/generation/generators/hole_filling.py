"""Push-pull filling of the pixels no capture saw, along the surfaces they lie on.

Push: each level halves the image. A cell keeps the mean of its known colours, those on
the plane of the cell's own holes first, and the mean surface those colours came from.
Pull: from the coarsest level down, what a cell does not know it takes from the coarser
cells around it, again those on its own plane first. So the hidden floor behind a table
is filled with floor and not with table.
"""

from __future__ import annotations

import numpy as np

from ...core.compiled import inlined, kernel

# A source this share of its distance off a pixel's plane counts a quarter; the floor lets
# colour through from anywhere when the pixel's own surface is wholly unknown.
_PLANE_DISTANCE = np.float32(0.05)
_OFF_PLANE = np.float32(1e-3)
_SMALLEST_WEIGHT = np.float32(1e-8)  # of a cell that knows anything: ten levels must not underflow


def fill_holes(image: np.ndarray, known: np.ndarray, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(H, W, 3) float32: ``image`` where ``known``, continued into where it is not.

    ``image`` (H, W, 3) float32; ``known`` (H, W), bool or in [0, 1], how far each pixel is:
    between, it is a guess, and the known colours near it prevail. ``points`` and ``normals``
    (H, W, 3) float32 are the surface seen at each pixel, relative to the camera's centre;
    normals are zero where there is no surface. An image that is wholly unknown comes back
    as it is.
    """
    if np.all(known == 1.0) or not np.any(known):
        return image
    surface = np.concatenate([points, normals], axis=2).astype(np.float32)
    source = np.concatenate([image, surface], axis=2).astype(np.float32)
    weight = known.astype(np.float32)
    levels = [(source, weight, surface)]
    hole_share = 1.0 - weight
    while weight.size > 1:
        source, weight, surface, hole_share = _push(source, weight, surface, hole_share)
        levels.append((source, weight, surface))
    filled = levels[-1][0]
    for source, weight, surface in levels[-2::-1]:
        filled = _pull(source, weight, surface, filled)
    return np.ascontiguousarray(filled[..., :3])


@inlined
def _on_plane(hole, source):
    """How far a colour's surface (colour, point, normal) lies on a hole's plane (point, normal)."""
    away = np.float32(0.0)
    cosine = np.float32(0.0)
    distance = np.float32(0.0)
    for axis in range(3):
        gap = source[3 + axis] - hole[axis]
        away += gap * hole[3 + axis]
        cosine += hole[3 + axis] * source[6 + axis]
        distance += hole[axis] * hole[axis]
    if hole[3] == 0.0 and hole[4] == 0.0 and hole[5] == 0.0:
        return np.float32(1.0)
    ratio = away * away / (_PLANE_DISTANCE * _PLANE_DISTANCE * distance + np.float32(1e-12))
    cosine = max(cosine, np.float32(0.0))
    return cosine * cosine / ((np.float32(1.0) + ratio) * (np.float32(1.0) + ratio)) + _OFF_PLANE


@kernel
def _push(source, weight, surface, hole_share):
    """One level up: ``source`` (h, w, 9), ``weight`` (h, w), holes' ``surface`` (h, w, 6), their share."""
    height, width = (weight.shape[0] + 1) // 2, (weight.shape[1] + 1) // 2
    out_source = np.zeros((height, width, 9), np.float32)
    out_weight = np.zeros((height, width), np.float32)
    out_surface = np.zeros((height, width, 6), np.float32)
    out_share = np.zeros((height, width), np.float32)
    for row in range(height):
        for column in range(width):
            rows = min(2, weight.shape[0] - 2 * row)
            columns = min(2, weight.shape[1] - 2 * column)
            surface_here = out_surface[row, column]
            share = np.float32(0.0)
            for r in range(2 * row, 2 * row + rows):
                for c in range(2 * column, 2 * column + columns):
                    share += hole_share[r, c]
                    for k in range(6):
                        surface_here[k] += hole_share[r, c] * surface[r, c, k]
            if share > 0.0:
                for k in range(6):
                    surface_here[k] /= share
            total = np.float32(0.0)
            for r in range(2 * row, 2 * row + rows):
                for c in range(2 * column, 2 * column + columns):
                    if weight[r, c] > 0.0:
                        w = weight[r, c]
                        if share > 0.0:
                            w *= _on_plane(surface_here, source[r, c])
                        total += w
                        for k in range(9):
                            out_source[row, column, k] += w * source[r, c, k]
            if total > 0.0:
                for k in range(9):
                    out_source[row, column, k] /= total
                # half of a cell known is enough to know the cell: fills from near rather than far
                total *= np.float32(2.0) / (rows * columns)
                out_weight[row, column] = min(max(total, _SMALLEST_WEIGHT), np.float32(1.0))
            out_share[row, column] = share / (rows * columns)
    return out_source, out_weight, out_surface, out_share


@kernel
def _pull(source, weight, surface, coarse):
    """One level down: ``source`` completed by the filled ``coarse`` level, (h, w, 9)."""
    height, width = weight.shape
    out = np.empty_like(source)
    for row in range(height):
        top = (row - 1) >> 1
        for column in range(width):
            missing = np.float32(1.0) - weight[row, column]
            for k in range(9):
                out[row, column, k] = source[row, column, k]
            if missing <= 0.0:
                continue
            left = (column - 1) >> 1
            for k in range(9):
                out[row, column, k] *= weight[row, column]
            total = np.float32(0.0)
            for attempt in range(2):
                for i in range(2):
                    for j in range(2):
                        r = min(max(top + i, 0), coarse.shape[0] - 1)
                        c = min(max(left + j, 0), coarse.shape[1] - 1)
                        # bilinear: the cell this pixel lies in has 3/4 along each axis
                        w = np.float32(0.75) if r == row >> 1 else np.float32(0.25)
                        w *= np.float32(0.75) if c == column >> 1 else np.float32(0.25)
                        w *= _on_plane(surface[row, column], coarse[r, c])
                        if attempt == 0:
                            total += w
                        else:
                            for k in range(9):
                                out[row, column, k] += missing * w / total * coarse[r, c, k]
    return out

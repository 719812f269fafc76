"""Plane sweeping: how alike photographs look when they are carried onto a plane (Collins 1996).

For each pixel of one view and each plane, a patch round the pixel is compared with what another view shows
of it, were it a part of that plane. Right planes are told by how many pixels look alike on them; no
feature need be matched, so a plain floor with a little grain does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ...core.cameras import Camera
from ...core.compiled import inlined, parallel_kernel, prange

NEAREST_M = 0.3
"""What is nearer to a camera is not compared."""

_STRIDE_PX = 6  # between pixels that are asked
_HIDDEN_FROM_M = 0.03  # how far behind a bound a point is out of the room
_PATCH_RADIUS_PX, _PATCH_STEP_PX = 6, 2
_LEAST_VARIANCE = 4e-6  # of grey levels: below this there is nothing but quantisation
_NO_BOUNDS = (np.zeros((0, 3)), np.zeros(0))


@dataclass(frozen=True)
class GreyView:
    """A photograph (H, W) float32 in grey at its camera in metres, and the planar depth known there, 0 unknown."""

    camera: Camera
    grey: np.ndarray
    known: np.ndarray

    @staticmethod
    def of(image: np.ndarray, camera: Camera, known: np.ndarray | None = None) -> GreyView:
        """Of an ``image`` (H, W, 3) float32 of the camera's size."""
        nothing = np.zeros(camera.shape, np.float32) if known is None else known
        return GreyView(camera, cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), nothing)


def textured_pixels(view: GreyView) -> np.ndarray:
    """(N, 2) int64 columns and rows of every few pixels without known depth that have some texture."""
    side = (2 * _PATCH_RADIUS_PX + 1,) * 2
    mean, square = cv2.boxFilter(view.grey, -1, side), cv2.sqrBoxFilter(view.grey, -1, side)
    asked = (view.known == 0) & (square - mean * mean > _LEAST_VARIANCE)
    inside = slice(_PATCH_RADIUS_PX, -_PATCH_RADIUS_PX, _STRIDE_PX)
    rows, columns = np.nonzero(asked[inside, inside])
    return np.stack([columns, rows], axis=1) * _STRIDE_PX + _PATCH_RADIUS_PX


def likeness_on_planes(
    view: GreyView,
    others: Sequence[GreyView],
    pixels: np.ndarray,
    normals: np.ndarray,
    offsets: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray] = _NO_BOUNDS,
    free_margin: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """For planes (D, 3), (D,) and pixels (N, 2): the best correlation (D, N) with another
    view, -2 without one, and whether some view looks through, bool.

    What lies behind one of the ``bounds``, normals (B, 3) inwards and offsets (B,), is out of the room. A view looks
    through where its known depth lies beyond the plane by the share ``free_margin``, and is not compared where it lies
    before it by as much.
    """
    axes = view.camera.world_from_camera[:3, :3] @ np.linalg.inv(view.camera.matrix)
    away = normals @ view.camera.centre - offsets
    rows = -(normals @ axes) / np.maximum(away, 1e-3)[:, None]
    onto = np.array([[_homography(view.camera, other.camera, row) for other in others] for row in rows])
    inwards, foot = bounds
    inside = inwards @ view.camera.centre - foot + _HIDDEN_FROM_M
    like = np.full((len(rows), len(pixels)), -2.0, np.float32)
    beyond = np.zeros(like.shape, np.bool_)
    _compare(
        view.grey,
        pixels,
        rows,
        np.column_stack([inwards @ axes, inside]),
        onto,
        tuple(other.grey for other in others),
        tuple(other.known for other in others),
        free_margin,
        like,
        beyond,
    )
    return like, beyond


def _homography(camera: Camera, other: Camera, row: np.ndarray) -> np.ndarray:
    """(3, 3) from pixels (x, y, 1) of ``camera`` to those of ``other`` times the ratio of their
    depths, through the plane of inverse depth ``row`` . (x, y, 1)."""
    relative = other.camera_from_world @ camera.world_from_camera
    return other.matrix @ (relative[:3, :3] @ np.linalg.inv(camera.matrix) + np.outer(relative[:3, 3], row))


@parallel_kernel
def _compare(grey, pixels, rows, bounds, onto, greys, known, free_margin, like, beyond):
    """``likeness_on_planes`` for planes of inverse depth ``rows`` (D, 3) . (x, y, 1).

    ``bounds`` (B, 4): a . (x, y, 1) z + b >= 0 in the room; ``onto`` (D, O, 3, 3)."""
    for d in prange(rows.shape[0]):
        for i in range(pixels.shape[0]):
            x, y = pixels[i, 0] + 0.5, pixels[i, 1] + 0.5
            inverse = rows[d, 0] * x + rows[d, 1] * y + rows[d, 2]
            if not 1e-6 < inverse < 1.0 / NEAREST_M:
                continue
            depth, inside = 1.0 / inverse, True
            for b in range(bounds.shape[0]):
                inside &= (bounds[b, 0] * x + bounds[b, 1] * y + bounds[b, 2]) * depth + bounds[b, 3] >= 0.0
            if not inside:
                continue
            for o in range(len(greys)):
                to = onto[d, o]
                reached = depth * (to[2, 0] * x + to[2, 1] * y + to[2, 2])
                if reached < NEAREST_M:
                    continue
                u = depth * (to[0, 0] * x + to[0, 1] * y + to[0, 2]) / reached
                v = depth * (to[1, 0] * x + to[1, 1] * y + to[1, 2]) / reached
                height, width = known[o].shape
                if not (0.0 <= u < width and 0.0 <= v < height):
                    continue
                there = known[o][int(v), int(u)]
                if there > reached * (1.0 + free_margin):
                    beyond[d, i] = True
                elif there == 0.0 or there > reached * (1.0 - free_margin):
                    found = _likeness(grey, greys[o], to, pixels[i, 0], pixels[i, 1])
                    like[d, i] = max(like[d, i], found)


@inlined
def _likeness(grey, other, to, column, row):
    """Correlation of the patch of ``grey`` round a pixel and what ``to`` makes it show of
    ``other``; -2 where that leaves the image."""
    height, width = other.shape
    a, b, aa, bb, ab, count = 0.0, 0.0, 0.0, 0.0, 0.0, 0
    left = False
    for j in range(-_PATCH_RADIUS_PX, _PATCH_RADIUS_PX + 1, _PATCH_STEP_PX):
        for i in range(-_PATCH_RADIUS_PX, _PATCH_RADIUS_PX + 1, _PATCH_STEP_PX):
            x, y = column + i + 0.5, row + j + 0.5
            w = to[2, 0] * x + to[2, 1] * y + to[2, 2]
            u = (to[0, 0] * x + to[0, 1] * y + to[0, 2]) / w - 0.5
            v = (to[1, 0] * x + to[1, 1] * y + to[1, 2]) / w - 0.5
            if w <= 0.0 or not (0.0 <= u < width - 1 and 0.0 <= v < height - 1):
                left = True
                break
            m, n = int(u), int(v)
            s, t = u - m, v - n
            upper = other[n, m] * (1.0 - s) + other[n, m + 1] * s
            lower = other[n + 1, m] * (1.0 - s) + other[n + 1, m + 1] * s
            here, there = float(grey[row + j, column + i]), upper * (1.0 - t) + lower * t
            a, b, aa, bb, ab = a + here, b + there, aa + here * here, bb + there * there, ab + here * there
            count += 1
        if left:
            break
    result = -2.0
    if not left:
        variances = (aa / count - (a / count) ** 2, bb / count - (b / count) ** 2)
        noise = _LEAST_VARIANCE
        result = (ab / count - a * b / count**2) / np.sqrt(
            (max(variances[0], 0.0) + noise) * (max(variances[1], 0.0) + noise)
        )
    return result

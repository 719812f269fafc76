"""Superpixels: small patches of one colour (SLIC; Achanta et al., TPAMI 2012).

Each pixel chooses among the centres of the grid's cells around its own, so that all choose at once
and the result does not depend on the number of threads. A patch need not be connected.
"""

from __future__ import annotations

import numpy as np

from ...core.compiled import parallel_kernel, prange

_ITERATIONS = 8
_REACH_CELLS = 2


def superpixels(colours: np.ndarray, side_px: int, compactness: float) -> np.ndarray:
    """(H, W) int32 patches of about ``side_px`` a side, numbered from 0 without gaps.

    ``colours`` (H, W, 3) float32; a difference of ``compactness`` between colours counts as
    much as a patch's side between places.
    """
    height, width = colours.shape[:2]
    rows, columns = max(height // side_px, 1), max(width // side_px, 1)
    y, x = np.mgrid[:height, :width]
    weight = compactness / side_px
    features = np.dstack([colours, y * weight, x * weight]).astype(np.float32)
    patches = (y * rows // height * columns + x * columns // width).astype(np.int32)
    centres = np.zeros((rows * columns, 5), np.float32)
    for _ in range(_ITERATIONS):
        _move_to_means(centres, features, patches)
        patches = _nearest(features, centres, rows, columns)
    _, patches = np.unique(patches, return_inverse=True)
    return patches.reshape(height, width).astype(np.int32)


def _move_to_means(centres: np.ndarray, features: np.ndarray, patches: np.ndarray) -> None:
    """Each centre to the mean of its pixels' features; one without pixels stays."""
    count = np.bincount(patches.ravel(), minlength=len(centres))
    for axis in range(features.shape[2]):
        total = np.bincount(patches.ravel(), features[..., axis].ravel(), minlength=len(centres))
        centres[:, axis] = np.where(count > 0, total / np.maximum(count, 1), centres[:, axis])


@parallel_kernel
def _nearest(features, centres, rows, columns):
    height, width, size = features.shape
    patches = np.zeros((height, width), np.int32)
    for y in prange(height):
        row = y * rows // height
        for x in range(width):
            column = x * columns // width
            best = np.float32(np.inf)
            for r in range(max(0, row - _REACH_CELLS), min(rows, row + _REACH_CELLS + 1)):
                for c in range(max(0, column - _REACH_CELLS), min(columns, column + _REACH_CELLS + 1)):
                    distance = np.float32(0.0)
                    for axis in range(size):
                        step = features[y, x, axis] - centres[r * columns + c, axis]
                        distance += step * step
                    if distance < best:
                        best = distance
                        patches[y, x] = r * columns + c
    return patches

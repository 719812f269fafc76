"""Patches of one image found again in another that is nearly aligned with it.

A patch is compared by normalised correlation, which light and contrast do not change, with
every place within reach. It is matched where the best place is much better than any other
one: repeated texture and bare walls have no such place, edges only along themselves.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

RADIUS_PX = 10
"""Patches are squares of 2 * RADIUS_PX + 1 pixels."""

# The smaller eigenvalue of the mean squared gradient (per pixel, image in [0, 1]) of a corner.
_SMALLEST_CORNER = 4e-6
# Correlations this near to 1 are told apart by the images' noise alone.
_INDISTINCT = 2e-3
_SAME_PEAK_PX = 4  # a second peak nearer than this is the flank of the best


class PatchMatches(NamedTuple):
    """Where patches were found.

    ``columns``, ``rows`` (n,) int64, the patches' centre pixels; ``places`` (n, 2) float64,
    their centres in the other image, pixels; ``scores`` (n,) float64, correlations.
    """

    columns: np.ndarray
    rows: np.ndarray
    places: np.ndarray
    scores: np.ndarray


def corners(image: np.ndarray, known: np.ndarray, cell_px: int) -> tuple[np.ndarray, np.ndarray]:
    """Columns and rows of the best corner of each cell whose whole patch is ``known``.

    ``image`` (H, W) float32 in [0, 1], ``known`` (H, W) bool.
    """
    size = 2 * RADIUS_PX + 1
    inside = cv2.erode(
        known.astype(np.uint8), np.ones((size, size), np.uint8), borderType=cv2.BORDER_CONSTANT, borderValue=(0,)
    )
    strength = cv2.cornerMinEigenVal(cv2.GaussianBlur(image, (0, 0), 1.0), 9, ksize=1)
    strength[inside == 0] = 0.0
    height, width = (side // cell_px * cell_px for side in image.shape)
    cells: np.ndarray = strength[:height, :width].reshape(height // cell_px, cell_px, width // cell_px, cell_px)
    # An image that holds no whole cell has no corner.
    cells = cells.transpose(0, 2, 1, 3).reshape(height // cell_px, width // cell_px, cell_px * cell_px)
    best = cells.argmax(axis=-1)
    row, column = np.nonzero(cells.max(axis=-1, initial=0.0) > _SMALLEST_CORNER)
    place = best[row, column]
    return column * cell_px + place % cell_px, row * cell_px + place // cell_px


def match_patches(
    image: np.ndarray,
    columns: np.ndarray,
    rows: np.ndarray,
    other: np.ndarray,
    reach_px: int,
    least_score: float,
    ratio: float,
) -> PatchMatches:
    """Find the patches of ``image`` around (columns, rows) in ``other``, both (H, W) float32.

    Looked for within ``reach_px`` of their own place. Kept when the correlation is at least
    ``least_score``, its peak lies inside the reach and the distance (the square root of one
    minus correlation) is below ``ratio`` times that of the second best place.
    """
    pad = reach_px + RADIUS_PX
    padded = cv2.copyMakeBorder(other, pad, pad, pad, pad, cv2.BORDER_CONSTANT, value=(0.0,))
    found = []
    for index, (column, row) in enumerate(zip(columns.tolist(), rows.tolist(), strict=True)):
        patch = image[row - RADIUS_PX : row + RADIUS_PX + 1, column - RADIUS_PX : column + RADIUS_PX + 1]
        window = padded[row : row + 2 * pad + 1, column : column + 2 * pad + 1]
        scores = cv2.matchTemplate(window, patch, cv2.TM_CCOEFF_NORMED)
        _, best, _, (x, y) = cv2.minMaxLoc(scores)
        if not (least_score <= best <= 1.001 and 0 < x < 2 * reach_px and 0 < y < 2 * reach_px):
            continue
        near = scores[y - 1 : y + 2, x - 1 : x + 2].copy()
        scores[
            max(0, y - _SAME_PEAK_PX) : y + _SAME_PEAK_PX + 1, max(0, x - _SAME_PEAK_PX) : x + _SAME_PEAK_PX + 1
        ] = -1.0
        second = min(float(scores.max()), 1.0)
        if max(1.0 - best, _INDISTINCT) >= ratio * ratio * (1.0 - second):
            continue
        found.append((index, x - reach_px + _peak(near[1]), y - reach_px + _peak(near[:, 1]), best))
    table = np.array(found).reshape(-1, 4)
    kept = table[:, 0].astype(np.int64)
    places = np.stack([columns[kept], rows[kept]], axis=1) + 0.5 + table[:, 1:3]
    return PatchMatches(columns[kept], rows[kept], places, table[:, 3])


def _peak(values: np.ndarray) -> float:
    """Where the parabola through three values, the middle one the largest, peaks, in [-0.5, 0.5]."""
    before, middle, after = map(float, values)
    bend = before - 2.0 * middle + after
    return 0.0 if bend >= 0.0 else float(np.clip(0.5 * (before - after) / bend, -0.5, 0.5))

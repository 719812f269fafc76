"""Splats that stand alone: what training left in the air. NumPy alone, as Blender runs it."""

from __future__ import annotations

import itertools

import numpy as np

from .regions import cells_of, keys_of


def neighbours(means: np.ndarray, distance_m: float) -> np.ndarray:
    """(N,) int64: how many of the points (N, 3) lie around each, itself counted.

    Around is the 3 x 3 x 3 block of cells of side ``distance_m`` with the point in its middle
    cell: all within the distance are counted, and none beyond 3.5 times it.
    """
    scale = 1.0 / distance_m
    keys = keys_of(cells_of(np.diag([scale, scale, scale, 1.0]), means))
    present, place, counts = np.unique(keys, return_inverse=True, return_counts=True)
    around = np.zeros(len(present), np.int64)
    for offset in itertools.product((-1, 0, 1), repeat=3):
        beside = present + (offset[0] << 42) + (offset[1] << 21) + offset[2]
        found = np.minimum(np.searchsorted(present, beside), len(present) - 1)
        around += np.where(present[found] == beside, counts[found], 0)
    return around[place.reshape(-1)]

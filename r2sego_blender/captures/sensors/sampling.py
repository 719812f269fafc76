"""Values of a depth map at places of its photograph, away from edges."""

from __future__ import annotations

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

# Depth next to an edge belongs to one side or the other.
_SMOOTH = 1.05


def smooth_pixels(depth: np.ndarray) -> np.ndarray:
    """(H, W) bool: known pixels whose neighbours are known and of the same surface."""
    kernel = np.ones((3, 3), np.uint8)
    low, high = cv2.erode(depth, kernel), cv2.dilate(depth, kernel)
    return (low > 0) & (high <= _SMOOTH * low)


def sampled(depth: np.ndarray, shares: np.ndarray, smooth: np.ndarray | None = None) -> np.ndarray:
    """Depth (n,) float64 at shares (n, 2) of width and height; 0 where unknown or beside an edge.

    ``smooth`` are the map's ``smooth_pixels``, if they are known already.
    """
    height, width = depth.shape
    smooth = smooth_pixels(depth) if smooth is None else smooth
    place = shares * [width, height] - 0.5  # SciPy counts pixel centres from zero
    values = map_coordinates(depth, place.T[::-1], order=1, mode="nearest")
    column, row = np.rint(place).astype(int).T
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    inside[inside] = smooth[row[inside], column[inside]]
    return np.where(inside, values, 0.0).astype(np.float64)

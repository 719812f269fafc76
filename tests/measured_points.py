"""Points as cameras would measure them: the sparse points of a capture whose truth is known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2sego_blender.captures.sparse_points import SparsePoints
from r2sego_blender.core.cameras import Camera


def measured(
    points: np.ndarray, cameras: Sequence[Camera], least_views: int = 0, margin_px: float = 0.0
) -> SparsePoints:
    """``points`` (P, 3) measured without error by each camera that has them in its image, those in
    at least ``least_views``. Nothing hides anything."""
    pixels = np.full((len(points), len(cameras), 2), np.nan, np.float32)
    for index, camera in enumerate(cameras):
        place, depth = camera.project(points)
        seen = camera.sees(place, depth, margin_px)
        pixels[seen, index] = place[seen]
    visibility = np.isfinite(pixels[..., 0])
    kept = visibility.sum(axis=1) >= least_views
    count = kept.sum()
    return SparsePoints(points[kept], np.zeros((count, 3), np.uint8), visibility[kept], np.zeros(count), pixels[kept])

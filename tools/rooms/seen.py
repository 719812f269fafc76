"""What cameras see of a true surface in common: overlap of captures, support gap of frozen views."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2sego_blender.core.cameras import Camera
from r2sego_blender.evaluation.surfaces.regions import seen_by, seen_by_captures


def overlap_share(cameras: Sequence[Camera], depths: Sequence[np.ndarray]) -> float:
    """The share of all pixels with a surface whose place another of the cameras sees too."""
    shared, all_pixels = 0, 0
    for index, (camera, depth) in enumerate(zip(cameras, depths, strict=True)):
        points = camera.unproject(depth)[depth > 0.0]
        others = [j for j in range(len(cameras)) if j != index]
        by_another = [seen_by(points, cameras[j], depths[j]) for j in others]
        shared += int(np.any(by_another, axis=0).sum()) if others else 0
        all_pixels += len(points)
    return shared / max(all_pixels, 1)


def support_gap(
    frozen: Sequence[Camera],
    frozen_depths: Sequence[np.ndarray],
    captures: Sequence[Camera],
    depths: Sequence[np.ndarray],
) -> float:
    """The share of the frozen views' pixels with a surface whose place no capture sees."""
    missed, all_pixels = 0, 0
    for camera, depth in zip(frozen, frozen_depths, strict=True):
        surface = depth > 0.0
        missed += int((surface & ~seen_by_captures(camera, depth, captures, depths)).sum())
        all_pixels += int(surface.sum())
    return missed / max(all_pixels, 1)

"""What cameras see of a true surface in common: overlap of captures, support gap of frozen views."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2sego_blender.core.cameras import Camera

_NEAR_M, _NEAR_SHARE = 0.02, 0.02
"""Two depths of one place may differ by this and by this share: pixels are wide where a floor is seen flatly."""


def seen_by(points: np.ndarray, camera: Camera, depth: np.ndarray) -> np.ndarray:
    """(...,) bool: whether a camera sees world points (..., 3) of the surface of which its planar ``depth`` (H, W) is.

    A depth of 0 is no surface, and hides nothing nor shows anything.
    """
    pixels, z = camera.project(points)
    inside = camera.sees(pixels, z)
    column, row = np.where(inside[..., None], pixels, 0.0).astype(int).transpose(-1, *range(inside.ndim))
    there = depth[row, column]
    seen: np.ndarray = inside & (there > 0.0) & (np.abs(there - z) <= _NEAR_M + _NEAR_SHARE * z)
    return seen


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
        points = camera.unproject(depth)[depth > 0.0]
        seen = np.zeros(len(points), bool)
        for capture, capture_depth in zip(captures, depths, strict=True):
            seen |= seen_by(points, capture, capture_depth)
        missed += int((~seen).sum())
        all_pixels += len(points)
    return missed / max(all_pixels, 1)

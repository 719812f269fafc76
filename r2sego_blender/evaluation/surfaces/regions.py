"""Frozen views apart into what captures saw and what none saw, and the scores of each region.

A region's PSNR in a view is that of the mean squared error over its pixels alone. Over several views it is the mean of
those that have the region, as the PSNR of whole pictures is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core.cameras import Camera
from ...geometry.visibility.point_visibility import looked_up, same_depth
from ...splats.metrics import psnr

LEAST_PIXELS = 100
"""A region of fewer pixels in a view is none: a few pixels are right or wrong by chance."""

_NEAR_M, _NEAR_SHARE = 0.02, 0.02
"""Two depths of one place may differ by this and by this share: pixels are wide where a floor is seen flatly."""
_FAR_M = 1000.0  # where rays end that meet no surface


def seen_by(points: np.ndarray, camera: Camera, depth: np.ndarray) -> np.ndarray:
    """(...,) bool: whether a camera sees world points (..., 3) of the surface of which its planar ``depth`` (H, W) is.

    A depth of 0 is no surface, and hides nothing nor shows anything.
    """
    seen, z, there = looked_up(points, camera, depth)
    seen[seen] = (there > 0.0) & _at_depth(there, z)
    return seen


def seen_by_captures(
    camera: Camera, depth: np.ndarray, capture_cameras: Sequence[Camera], capture_depths: Sequence[np.ndarray]
) -> np.ndarray:
    """(H, W) bool: which surface points of a view some capture sees too.

    ``depth`` and ``capture_depths`` (H, W) are planar metres of one surface, 0 where there is
    none. Where the view shows none, a capture that looks that way out of the surface too
    counts as seeing it.
    """
    surface = depth > 0.0
    seen = np.zeros(camera.shape, bool)
    points = camera.unproject(np.where(surface, depth, _FAR_M))
    for other, other_depth in zip(capture_cameras, capture_depths, strict=True):
        left = ~seen
        inside, z, there = looked_up(points[left], other, other_depth)
        new = np.zeros(len(inside), bool)
        new[inside] = np.where(surface[left][inside], (there > 0.0) & _at_depth(there, z), there <= 0.0)
        seen[left] = new
    return seen


@dataclass(frozen=True)
class RegionScore:
    """PSNR in dB of the pixels that captures saw and of those that none saw, and the latter's share of all.

    None where a region has fewer than ``LEAST_PIXELS``; infinite where it has no error.
    """

    psnr_seen: float | None
    psnr_unseen: float | None
    unseen: float


def region_score(image: np.ndarray, truth: np.ndarray, seen: np.ndarray) -> RegionScore:
    """Of one view; ``image`` and ``truth`` (H, W, 3) in [0, 1], ``seen`` (H, W) bool."""
    return RegionScore(_psnr(image, truth, seen), _psnr(image, truth, ~seen), float(np.mean(~seen)))


def mean_score(views: Sequence[RegionScore]) -> RegionScore:
    """Over views of one size."""
    return RegionScore(
        _mean([view.psnr_seen for view in views]),
        _mean([view.psnr_unseen for view in views]),
        float(np.mean([view.unseen for view in views])),
    )


def _mean(psnrs: Sequence[float | None]) -> float | None:
    known = [psnr for psnr in psnrs if psnr is not None]
    return float(np.mean(known)) if known else None


def _psnr(image: np.ndarray, truth: np.ndarray, region: np.ndarray) -> float | None:
    return psnr(image[region], truth[region]) if region.sum() >= LEAST_PIXELS else None


def _at_depth(shown: np.ndarray, z: np.ndarray) -> np.ndarray:
    return same_depth(shown, z, _NEAR_SHARE + _NEAR_M / z)

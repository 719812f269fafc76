"""Exposure gains that make captures agree where they see the same surface."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ...core.cameras import Camera
from ...geometry.visibility.point_visibility import looked_up, same_depth

_STRIDE_PX = 8  # of the pixels compared: thousands a capture are plenty for a median
_BLUR_PX = 4.0  # so that a pixel of misregistration does not read as a change of exposure
_DARKEST, _BRIGHTEST = 0.05, 0.95  # clipped pixels say nothing about exposure
_FEWEST_SAMPLES = 50
# Weight of "no change" against a pair's samples: captures that overlap nothing keep gain 1.
_PRIOR_SAMPLES = 20.0


def exposure_gains(
    images: Sequence[np.ndarray], cameras: Sequence[Camera], depths: Sequence[np.ndarray], tolerance: float
) -> np.ndarray:
    """(N, 3) float32: the factor of each capture's red, green and blue.

    ``images`` (H, W, 3) float32 in [0, 1], ``depths`` (H, W) metres. For each pair, the
    median log ratio of the colours of surface points that both see; then the logs of the
    gains that fit all pairs best, weighted by their samples. The gains' geometric mean is
    1, so the set keeps its exposure.
    """
    count = len(images)
    smooth = [cv2.GaussianBlur(image, (0, 0), _BLUR_PX) for image in images]
    rows, targets = [], []
    for a in range(count):
        for b in range(count):
            if a == b:
                continue
            ratios = _log_ratios(smooth[a], smooth[b], cameras[a], cameras[b], depths[a], depths[b], tolerance)
            if len(ratios) < _FEWEST_SAMPLES:
                continue
            weight = np.sqrt(len(ratios))
            row = np.zeros(count)
            row[a], row[b] = weight, -weight
            rows.append(row)
            targets.append(np.median(ratios, axis=0) * weight)
    if not rows:
        return np.ones((count, 3), np.float32)
    system = np.concatenate([np.stack(rows), np.sqrt(_PRIOR_SAMPLES) * np.eye(count)])
    wanted = np.concatenate([np.stack(targets), np.zeros((count, 3))])
    log_gains = np.linalg.lstsq(system, wanted, rcond=None)[0]
    return np.exp(log_gains - log_gains.mean(axis=0)).astype(np.float32)


def _log_ratios(
    image_a: np.ndarray,
    image_b: np.ndarray,
    camera_a: Camera,
    camera_b: Camera,
    depth_a: np.ndarray,
    depth_b: np.ndarray,
    tolerance: float,
) -> np.ndarray:
    """(n, 3): log of b's over a's colour at points of a that b sees."""
    grid = (slice(_STRIDE_PX // 2, None, _STRIDE_PX),) * 2
    points = camera_a.unproject(depth_a)[grid].reshape(-1, 3)
    inside, z, shown, colour_b = looked_up(points, camera_b, depth_b, image_b, margin_px=1.0)
    both_see = (depth_a[grid].ravel()[inside] > 0.0) & same_depth(shown, z, tolerance)
    colour_a, colour_b = image_a[grid].reshape(-1, 3)[inside][both_see], colour_b[both_see]
    both = np.concatenate([colour_a, colour_b], axis=1)
    usable = (both > _DARKEST).all(axis=1) & (both < _BRIGHTEST).all(axis=1)
    return np.log(colour_b[usable]) - np.log(colour_a[usable])

"""True depth disturbed as models of one photograph disturb it."""

from __future__ import annotations

import cv2
import numpy as np


def disturbed(depth: np.ndarray, rng: np.random.Generator, off: float = 0.05, blur_px: float = 0.7) -> np.ndarray:
    """``depth`` (H, W) under a scale and a shift of its own, float32: edges blurred, and ``off`` by a relative
    error, one sigma, that varies over a fifth of the picture."""
    height, width = depth.shape
    error = cv2.resize(rng.standard_normal((5, 6)).astype(np.float32), (width, height), interpolation=cv2.INTER_CUBIC)
    error *= off / error.std()
    mixed = cv2.GaussianBlur(depth, (0, 0), blur_px) * np.exp(error)
    return (rng.uniform(0.3, 3.0) * mixed + rng.uniform(0.0, 0.5)).astype(np.float32)

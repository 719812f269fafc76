"""The photometric loss of two images, for tests."""

from __future__ import annotations

import numpy as np

from r2sego_blender.splats.kernels.loss import PhotometricLoss
from r2sego_blender.splats.kernels.tiles import planes_of


def photometric_loss(image: np.ndarray, target: np.ndarray, ssim_weight: float) -> tuple[float, np.ndarray]:
    """The loss of two images (H, W, 3) float32, and its gradient in the first, of its shape."""
    height, width = image.shape[:2]
    gradient = planes_of(np.zeros_like(image))
    loss = PhotometricLoss(height, width)(planes_of(image), planes_of(target), ssim_weight, gradient)
    return loss, np.ascontiguousarray(np.moveaxis(gradient[:, :height, :width], 0, 2))

"""Image metrics as the original 3DGS code computes them: PSNR and SSIM on [0, 1]."""

from __future__ import annotations

import cv2
import numpy as np

SSIM_RADIUS_PX = 5
SSIM_SIGMA_PX = 1.5
SSIM_C1, SSIM_C2 = 0.01**2, 0.03**2


def ssim_window() -> np.ndarray:
    """(11,) float64, the normalised Gaussian window of SSIM."""
    offsets_px = np.arange(-SSIM_RADIUS_PX, SSIM_RADIUS_PX + 1)
    weights = np.exp(-(offsets_px**2) / (2.0 * SSIM_SIGMA_PX**2))
    return weights / weights.sum()


def psnr(image: np.ndarray, reference: np.ndarray) -> float:
    """Peak signal-to-noise ratio in dB of two images, or parts of them, (..., 3) in [0, 1]; inf when equal."""
    error = np.mean((np.asarray(image, np.float64) - reference) ** 2)
    return float("inf") if error == 0.0 else float(-10.0 * np.log10(error))


def ssim(image: np.ndarray, reference: np.ndarray) -> float:
    """Mean structural similarity of two (H, W, 3) images in [0, 1].

    An 11x11 Gaussian window, sigma 1.5, over all pixels, with zeros outside the image.
    """
    x, y = np.asarray(image, np.float64), np.asarray(reference, np.float64)
    window = ssim_window()

    def blurred(values: np.ndarray) -> np.ndarray:
        return cv2.sepFilter2D(values, cv2.CV_64F, window, window, borderType=cv2.BORDER_CONSTANT)

    mean_x, mean_y = blurred(x), blurred(y)
    variance_x = blurred(x * x) - mean_x**2
    variance_y = blurred(y * y) - mean_y**2
    covariance = blurred(x * y) - mean_x * mean_y
    luminance = (2.0 * mean_x * mean_y + SSIM_C1) / (mean_x**2 + mean_y**2 + SSIM_C1)
    structure = (2.0 * covariance + SSIM_C2) / (variance_x + variance_y + SSIM_C2)
    return float(np.mean(luminance * structure))

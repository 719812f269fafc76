"""Sensor noise: measured in a photograph, and smoothed away before it is matched.

On a wall with little texture noise is most of what a matching window holds, and 1 - NCC
drowns in it; a blur of less than a pixel takes more of the noise than of the texture.
"""

from __future__ import annotations

import cv2
import numpy as np

# The difference of two Laplacians, blind to planes and to edges along either axis, and its norm
# (Immerkaer, "Fast Noise Variance Estimation", 1996).
_MASK = np.array([[1.0, -2.0, 1.0], [-2.0, 4.0, -2.0], [1.0, -2.0, 1.0]], np.float32)
_MASK_NORM = 6.0
# Half of a normal distribution lies within this many standard deviations.
_MEDIAN_DEVIATION = 0.6745
# Noise is measured in the quarter of the image's squares that have the least texture.
_SQUARE_PX = 16
_CALMEST_SHARE = 0.25
# Noise that is left: one 8-bit step, below which it costs stereo nothing.
_QUIET = 1.0 / 255.0
_WIDEST_BLUR_PX = 1.2


def noise_sigma(grey: np.ndarray) -> float:
    """The standard deviation of the noise in an image (H, W) in [0, 1], from its calmest parts.

    Zero for an image smaller than a square of 16 pixels.
    """
    response = np.abs(cv2.filter2D(np.asarray(grey, np.float32), -1, _MASK, borderType=cv2.BORDER_REFLECT))
    rows, columns = (size // _SQUARE_PX for size in response.shape)
    if rows == 0 or columns == 0:
        return 0.0
    whole = response[: rows * _SQUARE_PX, : columns * _SQUARE_PX]
    squares = whole.reshape(rows, _SQUARE_PX, columns, _SQUARE_PX)
    medians = np.median(squares, axis=(1, 3))
    return float(np.quantile(medians, _CALMEST_SHARE) / (_MEDIAN_DEVIATION * _MASK_NORM))


def without_noise(grey: np.ndarray) -> np.ndarray:
    """The image (H, W) float32 in [0, 1], blurred just enough to leave noise of an 8-bit step.

    An image with no more noise than that is returned as it is. The blur is at most 1.2 px wide.
    """
    sigma = noise_sigma(grey)
    if sigma <= _QUIET:
        return grey
    # White noise after a Gaussian of s pixels has 1 / (2 sqrt(pi) s) of its deviation.
    blur_px = min(sigma / (2.0 * np.sqrt(np.pi) * _QUIET), _WIDEST_BLUR_PX)
    return cv2.GaussianBlur(grey, (0, 0), blur_px, borderType=cv2.BORDER_REFLECT)

"""How sharp a photograph is beside others that show the same."""

from __future__ import annotations

import cv2
import numpy as np

from ..core.images import resize

SIDE_PX = 640
"""Longest side at which sharpness is measured: captures are as large by default."""


def reduced_grey(image: np.ndarray) -> np.ndarray:
    """An RGB image (H, W, 3) uint8 in grey, (h, w) uint8, at most ``SIDE_PX`` long."""
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    height, width = grey.shape
    share = min(1.0, SIDE_PX / max(height, width))
    return resize(grey, max(1, round(width * share)), max(1, round(height * share)))


def sharpness(grey: np.ndarray) -> float:
    """The variance of the Laplacian of a grey image (H, W) uint8: blur lowers it, as does an empty wall.

    Only images that show the same can be compared by it.
    """
    return float(cv2.Laplacian(grey, cv2.CV_32F).var())

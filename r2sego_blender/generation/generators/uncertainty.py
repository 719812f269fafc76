"""Uncertain pixels of a generated frame, softened towards what lies around them.

Where captures disagree or none saw anything, a sharp edge is as likely in a wrong place as in
the right one, and one in a wrong place costs twice: where it stands and where it is missing.
The mean of what may be there is softer, and nearer to the truth on average.
"""

from __future__ import annotations

import cv2
import numpy as np

_REACH = 1.0 / 256.0  # standard deviation of the softening over the image's width
_SURE = 0.6  # pixels of this confidence and more stay as they are
_MOST = 0.9  # how far a pixel without any confidence becomes the mean around it
_LEAST_WEIGHT = np.float32(1e-3)  # of a pixel in that mean: some may all be without confidence


def soften_uncertain(image: np.ndarray, confidence: np.ndarray) -> np.ndarray:
    """(H, W, 3) float32: ``image`` (H, W, 3), each pixel softened as far as it is uncertain.

    ``confidence`` (H, W) float32 in [0, 1] says how far each pixel is known; in the means that
    uncertain pixels are drawn to, it is the weight of what lies around them.
    """
    uncertainty = np.clip(1.0 - confidence / np.float32(_SURE), 0.0, 1.0)
    if not uncertainty.any():
        return image
    sigma_px = _REACH * image.shape[1]
    weight = confidence + _LEAST_WEIGHT
    mean: np.ndarray = cv2.GaussianBlur(image * weight[..., None], (0, 0), sigma_px)
    mean /= cv2.GaussianBlur(weight, (0, 0), sigma_px)[..., None]
    return image + np.float32(_MOST) * uncertainty[..., None] * (mean - image)

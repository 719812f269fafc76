"""Linear light of sRGB colours, as Blender's materials and views, EXRs and glTF want it. NumPy alone."""

from __future__ import annotations

import numpy as np


def linear_from_srgb(srgb: np.ndarray) -> np.ndarray:
    """The linear values of sRGB ones in [0, 1], float32 of the same shape."""
    srgb = np.clip(np.asarray(srgb, np.float32), 0.0, 1.0)
    curved = np.power((srgb + np.float32(0.055)) / np.float32(1.055), np.float32(2.4))
    return np.where(srgb <= 0.04045, srgb / np.float32(12.92), curved).astype(np.float32)


def srgb_from_linear(linear: np.ndarray) -> np.ndarray:
    """The sRGB values of linear ones, those beyond [0, 1] clipped, float32 of the same shape."""
    linear = np.clip(np.asarray(linear, np.float32), 0.0, 1.0)
    curved = np.float32(1.055) * np.power(linear, np.float32(1.0 / 2.4)) - np.float32(0.055)
    return np.where(linear <= 0.0031308, linear * np.float32(12.92), curved).astype(np.float32)

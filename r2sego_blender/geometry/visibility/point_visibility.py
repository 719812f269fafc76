"""What images say at the pixels of points of the world. NumPy alone: Blender asks too."""

from __future__ import annotations

import numpy as np

from ...core.cameras import Camera

PROXY_ROUGHNESS_M = np.float32(0.01)
"""Differences of depth below a centimetre are the proxy's own roughness, at any distance."""


def looked_up(points: np.ndarray, camera: Camera, *images: np.ndarray) -> tuple[np.ndarray, ...]:
    """Which of ``points`` (..., 3) fall on the camera's image: (...,) bool; the planar depth of
    those, (n,) metres; and what each of its ``images`` (H, W, ...) has at their pixels (n, ...).
    """
    pixels, depth = camera.project(points)
    inside = camera.sees(pixels, depth)
    columns, rows = pixels[inside].astype(np.int64).T
    return inside, depth[inside], *(image[rows, columns] for image in images)


def same_depth(shown: np.ndarray, depth: np.ndarray, tolerance: float | np.ndarray) -> np.ndarray:
    """(n,) bool: where an image's depth is that of the point there, within ``tolerance``, relative, one or (n,)."""
    return np.abs(shown - depth) < tolerance * depth

"""Which depth the sparse points around a pixel speak for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from ...core.cameras import Camera

_FINEST_SHARE = 1 / 135  # of the picture's width
_SCALES = (1.0, 2.0, 4.0, 8.0)  # a point's weight falls about with its distance
_HALF_SURE = 0.25  # the weight at which points are half believed


@dataclass(frozen=True)
class PointEvidence:
    """Points that a capture measured: the ``rows`` and ``columns`` (n,) of their pixels, the planar ``depth`` (n,) in
    metres, and where they are in the ``world`` (n, 3); ``shape`` is the picture's."""

    rows: np.ndarray
    columns: np.ndarray
    depth: np.ndarray
    world: np.ndarray
    shape: tuple[int, int]

    @staticmethod
    def of(camera: Camera, points: np.ndarray) -> PointEvidence:
        """Of the world's ``points`` (n, 3), those that ``camera`` sees."""
        pixels, depth = camera.project(points)
        seen = camera.sees(pixels, depth)
        columns, rows = pixels[seen].astype(np.int64).T
        return PointEvidence(rows, columns, depth[seen], points[seen], camera.shape)

    def against(self, depth: np.ndarray, scale: float) -> tuple[np.ndarray, np.ndarray]:
        """How much the points around each pixel differ from a surface's ``depth`` (H, W), 0 where it is none: (H, W)
        in [0, 1], 1 from the relative difference ``scale``; and how sure that is, (H, W) in [0, 1]."""
        off = np.minimum(np.abs(self.depth - depth[self.rows, self.columns]) / (scale * self.depth), 1.0)
        return self._spread(off) / np.maximum(self._weight, 1e-6), self._weight / (self._weight + _HALF_SURE)

    @cached_property
    def _weight(self) -> np.ndarray:
        return self._spread(np.ones(len(self.depth)))

    def _spread(self, values: np.ndarray) -> np.ndarray:
        image = np.zeros(self.shape, np.float32)
        np.add.at(image, (self.rows, self.columns), values.astype(np.float32))
        blurred = np.zeros(self.shape, np.float32)
        finest_px = _FINEST_SHARE * self.shape[1]
        for scale in _SCALES:
            peak = np.float32(2.0 * np.pi * scale * finest_px**2)  # Gaussians as high as their scale is small
            blurred += peak * cv2.GaussianBlur(image, (0, 0), scale * finest_px, borderType=cv2.BORDER_CONSTANT)
        return blurred

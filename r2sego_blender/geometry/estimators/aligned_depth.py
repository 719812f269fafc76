"""An estimate brought to the registered poses: what of it is valid, and how sure it is. NumPy alone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...bundle import layout
from ...captures.per_capture import each_capture
from ...captures.sensors.sensor_maps import depth_and_sigma
from ...core.arrays import opened_arrays, save_arrays
from ...core.cameras import Camera
from ...core.errors import GeometryError
from ..stereo.observed_geometry import FARTHEST_M

_USUAL_SIGMA = 0.05


def certainty_of(sigma: np.ndarray) -> np.ndarray:
    """How much an estimate of relative ``sigma`` counts, float32 in (0, 1]: half where it is 5 % off."""
    certainty: np.ndarray = 1.0 / (1.0 + np.square(sigma / np.float32(_USUAL_SIGMA)))
    return certainty.astype(np.float32)


@dataclass(frozen=True)
class AlignedDepth:
    """``depth`` (H, W) float32 planar metres, 0 where the estimate is not valid; ``sigma`` (H, W) float32, its
    relative standard deviation where it is; ``camera`` the camera of both."""

    depth: np.ndarray
    sigma: np.ndarray
    camera: Camera

    def save(self, path: Path) -> None:
        """Write the maps and the camera as an uncompressed ``.npz``."""
        save_arrays(path, depth=self.depth, sigma=self.sigma, **self.camera.to_arrays())

    @staticmethod
    def load(path: Path) -> AlignedDepth:
        """Read what ``save`` wrote. Raises GeometryError when the file is none of it."""
        with opened_arrays(path, GeometryError, "this is no aligned estimate") as data:
            camera = Camera.from_arrays(data)
            return AlignedDepth(**depth_and_sigma(data, f"{camera.height} {camera.width}", FARTHEST_M), camera=camera)


ESTIMATED = each_capture(layout.ESTIMATED, AlignedDepth.load)
"""The estimated depth of each capture, in the world's metres."""

"""What an estimator says of a capture's depth, as the bundle keeps it. NumPy alone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...bundle import layout
from ...captures.per_capture import each_capture
from ...captures.sensors.sensor_maps import depth_and_sigma
from ...core.arrays import opened_arrays, save_arrays
from ...core.errors import GeometryError

_MOST = 1e6  # in the estimator's unit
_MOST_PIXELS = 1 << 26


@dataclass(frozen=True)
class EstimatedDepth:
    """Depth as the capture's camera sees it, in the estimator's own unit, or up to a shift of it or of its inverse.

    ``depth`` (H, W) float32 planar, 0 where the estimate is not valid; ``sigma`` (H, W) float32 relative, more
    than 0 where it is: only its proportions count, for its level is what residuals say. Both are of the
    capture's camera, ``capture.camera.fitted(max(H, W))``, without distortion.
    """

    depth: np.ndarray
    sigma: np.ndarray

    @property
    def valid(self) -> np.ndarray:
        """(H, W) bool: where it says anything."""
        known: np.ndarray = self.depth > 0.0
        return known

    def save(self, path: Path) -> None:
        """Write the maps as an uncompressed ``.npz``."""
        save_arrays(path, depth=self.depth, sigma=self.sigma)

    @staticmethod
    def load(path: Path) -> EstimatedDepth:
        """Read what ``save`` wrote. Raises GeometryError when the file is none of it."""
        cure = "Record the maps again with `r2sego estimate-depth`."
        with opened_arrays(path, GeometryError, "this is no estimated depth", cure) as data:
            maps = depth_and_sigma(data, "H W", _MOST)
            if not 0 < maps["depth"].size <= _MOST_PIXELS or any(one.dtype != np.float32 for one in maps.values()):
                raise ValueError(f"it is {maps['depth'].dtype} of shape {maps['depth'].shape}")
            return EstimatedDepth(**maps)


ESTIMATES = each_capture(layout.ESTIMATES, EstimatedDepth.load)
"""What an estimator said of those captures that it knows."""

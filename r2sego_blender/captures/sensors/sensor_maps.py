"""What a depth sensor measured of each capture, as the bundle keeps it. NumPy alone."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...bundle import layout
from ...core.arrays import Arrays, opened_arrays, require_between, require_shapes, save_arrays
from ...core.cameras import Camera
from ...core.errors import CaptureError
from ..per_capture import each_capture

_FARTHEST_M = 1e6


@dataclass(frozen=True)
class SensorMap:
    """Depth as the capture's camera sees it, at about the sensor's own resolution, in the world's metres.

    ``depth`` (H, W) float32 planar, 0 = unknown; ``sigma`` (H, W) float32, its standard deviation in
    metres where depth is known; ``camera`` is the capture's at this size, without distortion.
    """

    depth: np.ndarray
    sigma: np.ndarray
    camera: Camera

    def transformed(self, similarity: np.ndarray) -> SensorMap:
        """This map after a (4, 4) similarity of the world."""
        scale = np.float32(np.cbrt(np.linalg.det(similarity[:3, :3])))
        return replace(
            self, depth=self.depth * scale, sigma=self.sigma * scale, camera=self.camera.transformed(similarity)
        )

    def save(self, path: Path) -> None:
        """Write the maps and the camera as an uncompressed ``.npz``."""
        save_arrays(path, depth=self.depth, sigma=self.sigma, **self.camera.to_arrays())

    @staticmethod
    def load(path: Path) -> SensorMap:
        """Read what ``save`` wrote. Raises CaptureError when the file is none of it."""
        cure = "Make the scene anew with `r2sego new`."
        with opened_arrays(path, CaptureError, "this is no sensor's depth", cure) as data:
            camera = Camera.from_arrays(data)
            return SensorMap(**depth_and_sigma(data, f"{camera.height} {camera.width}", _FARTHEST_M), camera=camera)


def depth_and_sigma(data: Arrays, axes: str, most: float) -> dict[str, np.ndarray]:
    """The maps ``depth`` and ``sigma`` of a file. Raises ValueError, as damage in ``opened_arrays``: for other ``axes``
    (``require_shapes``), for numbers beyond ``most``, and for a depth without a deviation."""
    maps = {name: data[name] for name in ("depth", "sigma")}
    require_shapes(maps, **dict.fromkeys(maps, axes))
    require_between(0.0, most, **maps)
    if (maps["sigma"][maps["depth"] > 0.0] <= 0.0).any():
        raise ValueError("a depth is said to be exact")
    return maps


SENSOR_DEPTH = each_capture(layout.SENSOR_DEPTH, SensorMap.load)
"""The depth that a sensor measured, of those captures that have it."""

"""A capture's completed depth: every pixel's, and where it comes from. NumPy alone."""

from __future__ import annotations

import json
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

import numpy as np

from ...bundle import layout
from ...captures.per_capture import each_capture
from ...core.arrays import opened_arrays, require_between, require_shapes, save_arrays
from ...core.cameras import Camera
from ...core.errors import GeometryError
from ...core.json_files import parse_json
from ..stereo.observed_geometry import FARTHEST_M


class DepthSource(IntEnum):
    """Where a pixel of a completed depth map comes from."""

    OBSERVED = 0
    PLANE = 1
    ENVELOPE = 2
    FILLED = 3
    MEASURED = 4
    ESTIMATED = 5


@dataclass(frozen=True)
class CompletedDepth:
    """A capture's depth without holes.

    ``depth`` (H, W) float32 planar metres, 0 only where nothing at all is known; ``source``
    (H, W) uint8 of ``DepthSource``; ``camera`` the camera of both. ``certainty`` (H, W) float32 in [0, 1] of pixels
    that were ESTIMATED, 0 elsewhere; None where there is no estimate of the capture.
    """

    depth: np.ndarray
    source: np.ndarray
    camera: Camera
    certainty: np.ndarray | None = None

    @property
    def seen(self) -> np.ndarray:
        """(H, W) bool: pixels whose surface was seen there, by stereo or by a sensor."""
        return (self.source == DepthSource.OBSERVED) | (self.source == DepthSource.MEASURED)

    def save(self, path: Path) -> None:
        """Write the maps and the camera as an uncompressed ``.npz``."""
        maps = {"depth": self.depth, "source": self.source}
        if self.certainty is not None:
            maps["certainty"] = self.certainty
        save_arrays(path, **maps, camera=json.dumps(self.camera.to_json()))

    @staticmethod
    def load(path: Path) -> CompletedDepth:
        """Read what ``save`` wrote. Raises GeometryError when the file is no completed depth."""
        with opened_arrays(path, GeometryError, "this is not a completed depth map") as data:
            camera = Camera.from_json(parse_json(str(data["camera"])))
            maps = {
                name: data[name] for name in ("depth", "source", "certainty") if name != "certainty" or name in data
            }
            require_shapes(maps, **dict.fromkeys(maps, f"{camera.height} {camera.width}"))
            require_between(0.0, FARTHEST_M, depth=maps["depth"])
            if maps["source"].dtype != np.uint8 or maps["source"].max(initial=0) > max(DepthSource):
                raise ValueError("source tells of another origin")
            if "certainty" in maps:
                require_between(0.0, 1.0, certainty=maps["certainty"])
            elif (maps["source"] == DepthSource.ESTIMATED).any():
                raise ValueError("nothing says how certain the estimates are")
            return CompletedDepth(**maps, camera=camera)


COMPLETED = each_capture(layout.COMPLETED, CompletedDepth.load)
"""The completed depth of each capture."""

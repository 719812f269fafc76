"""Depth maps of a folder, of any origin: what anybody's model said of the photographs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from ...bundle.layout import mask_stems
from ...captures.capture import Capture
from ...captures.sensors.measuring import straightened
from ...captures.sensors.sensor_depth import map_in_own_unit
from ...captures.sparse_points import SparsePoints
from ...core.errors import CaptureError
from .estimated_depth import EstimatedDepth

BACKENDS = {"recorded": "recorded depth maps"}
ORDER = 0

_MOST_DEPTH = 1e5  # in the maps' unit, of an inverse that is next to nothing


@dataclass(frozen=True)
class Estimator:
    """Maps in ``folder`` that are called as the photographs are, as a sensor's (``SensorDepth``), in any one unit.

    ``inverse``: they hold inverse depth. Kept at the captures' working size at most.
    """

    folder: Path
    inverse: bool = False
    label: ClassVar[str] = BACKENDS["recorded"]

    def estimate(self, captures: Sequence[Capture], sparse: SparsePoints) -> Mapping[str, EstimatedDepth]:
        """See ``backends.DepthEstimator``. Raises CaptureError for a damaged map, and where there is none at all."""
        if not self.folder.is_dir():
            raise CaptureError("there is no such folder", where=self.folder, cure="Give the folder of depth maps.")
        stems = mask_stems([capture.name for capture in captures])
        found = {}
        for capture in captures:
            values = map_in_own_unit(self.folder, stems[capture.name], capture)
            if values is not None:
                if not (values > 0.0).any():
                    raise CaptureError(
                        f"the depth map of {capture.name} knows no depth anywhere",
                        where=self.folder,
                        cure="Make it again, or take it away.",
                    )
                found[capture.name] = self._of(capture, values)
        if not found:
            raise CaptureError(
                "no depth map belongs to a photograph of the scene",
                where=self.folder,
                cure=f"Call them as the photographs, such as {next(iter(stems.values()))}.npy or .png.",
            )
        return found

    def _of(self, capture: Capture, values: np.ndarray) -> EstimatedDepth:
        if self.inverse:
            depth = np.where(values > 1.0 / _MOST_DEPTH, 1.0 / np.maximum(values, 1.0 / _MOST_DEPTH), 0.0)
            values = depth.astype(np.float32)
        depth, _ = straightened(capture, values, np.ones_like(values))
        return EstimatedDepth(depth, np.where(depth > 0.0, np.float32(1.0), np.float32(0.0)))

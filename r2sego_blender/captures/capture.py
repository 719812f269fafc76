"""A capture (I_i, pi_i): one registered photograph."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..cameras import Camera
from ..images import load_image, resize


@dataclass(frozen=True)
class Capture:
    """One photograph and the calibrated camera it was taken with, in the world frame."""

    name: str
    image_path: Path
    camera: Camera

    def image(self) -> np.ndarray:
        """The photograph at its camera's size, (H, W, 3) float32 in [0, 1]."""
        return resize(load_image(self.image_path), self.camera.width, self.camera.height)

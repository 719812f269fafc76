"""Raw exports of Polycam (github.com/PolyCam/polyform, README): keyframes with ARKit's axes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...core.errors import CaptureError
from ...core.progress import SILENT, Progress
from ..lenses.lens import Lens
from ..sensors.sensor_depth import SensorDepth
from ..sharpness import sharpest
from . import json_fields as fields
from .finding import find_photographs
from .photographs import Photograph, require_lens_of_size, upright_size, with_unique_names
from .transforms_json import GL_FROM_CV

# Undistorting leaves a black border of this many pixels in ``corrected_images``.
_CORRECTED_BORDER_PX = 15.0
# "The max range of the lidar sensor is 5M, so [...] anything larger than that is a total guess."
LIDAR_RANGE_M = 5.0
UP = np.array([0.0, 1.0, 0.0])
"""ARKit's world has gravity along -Y."""


def read_polycam(keyframes: Path, most: int, progress: Progress = SILENT) -> tuple[list[Photograph], str]:
    """The photographs of a ``keyframes`` folder, in metres with +Y up, and their source in words.

    The undistorted photographs with poses that Polycam optimised are taken where there are
    both, else the original ones with ARKit's poses. Of more than ``most``, the sharpest of
    each ``most``-th part of the scan is taken, and said. Photographs that are missing are left
    out with a warning.
    """
    optimised = all((keyframes / f"corrected_{name}").is_dir() for name in ("cameras", "images"))
    kind = "corrected_" if optimised else ""
    cameras, images = keyframes / f"{kind}cameras", keyframes / f"{kind}images"
    # A zip packed on a Mac has a hidden file beside each.
    files = [path for path in cameras.glob("*.json") if not path.name.startswith(".")]
    files.sort(key=lambda path: (len(path.stem), path.stem))
    if not files:
        raise CaptureError("there are no camera files", where=cameras, cure="Export the raw data again.")
    stems = [path.stem for path in files]
    paths = find_photographs(stems, (images,), images, progress, guess_suffix=True)
    found = [(file, path) for file, path in zip(files, paths, strict=True) if path is not None]
    found = sharpest(found, [path for _, path in found], most, "keyframes", progress)
    border_px = _CORRECTED_BORDER_PX if optimised else 0.0
    photographs = [_photograph(file, path, border_px) for file, path in found]
    source = "Polycam, optimised poses" if optimised else "Polycam, ARKit's poses as recorded"
    return with_unique_names(photographs), source


def lidar_depth(folder: Path) -> SensorDepth | None:
    """The LiDAR's depth maps beside ARKit's frames, with their confidence, if the folder has them."""
    depth, confidence = folder / "depth", folder / "confidence"
    if not depth.is_dir():
        return None
    return SensorDepth(depth, confidence if confidence.is_dir() else None, LIDAR_RANGE_M)


def _photograph(file: Path, path: Path, border_px: float) -> Photograph:
    data = fields.read_json(file)
    rows = [[fields.number(f"t_{i}{j}", file, "pose", data) for j in range(4)] for i in range(3)]
    pose = np.array([*rows, [0.0, 0.0, 0.0, 1.0]]) @ GL_FROM_CV
    fx, fy, cx, cy = (fields.number(key, file, "intrinsics", data, positive=True) for key in ("fx", "fy", "cx", "cy"))
    width, height = upright_size(path)
    if "width" in data:
        width, height = fields.size(file, "intrinsics", data)
    lens = Lens(width, height, fx, fy, cx, cy, border_px=border_px)
    if "width" not in data:
        require_lens_of_size(lens, file, ("width", "height"))
    return Photograph(path.name, path, lens, pose, str(file))

"""Exports of Record3D as EXR and JPG (record3d.app): ``metadata.json``, ``rgb`` and ``depth``.

ARKit's poses stand as ``[qx, qy, qz, qw, x, y, z]`` a frame, OpenGL camera-to-world in metres, and the intrinsics
``K`` column by column, for ``w`` x ``h`` pixels; newer ones have ``[fx, fy, cx, cy]`` a frame beside it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import CaptureError
from ...core.progress import SILENT, Progress
from ..lenses.lens import Lens
from ..sensors.sensor_depth import SensorDepth
from ..sharpness import sharpest
from . import json_fields as fields
from .finding import find_photographs
from .photographs import Photograph, with_unique_names
from .polycam import LIDAR_RANGE_M
from .trajectories import pose_of
from .transforms_json import GL_FROM_CV

_POSE_NUMBERS, _MATRIX_NUMBERS, _LENS_NUMBERS = 7, 9, 4


def read_record3d(file: Path, most: int, progress: Progress = SILENT) -> list[Photograph]:
    """The photographs that a ``metadata.json`` tells of, in metres.

    Of more than ``most`` the sharpest of each ``most``-th part of the recording is taken, and said. Photographs
    that are missing are left out with a warning.
    """
    data = fields.read_json(file)
    poses = _numbers(data, "poses", _POSE_NUMBERS, file)
    width, height = fields.size(file, "", data, keys=("w", "h"))
    matrix = _numbers({"K": [data.get("K")]}, "K", _MATRIX_NUMBERS, file)[0].reshape(3, 3).T
    lenses = np.tile([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]], (len(poses), 1))
    if data.get("perFrameIntrinsicCoeffs"):
        own = _numbers(data, "perFrameIntrinsicCoeffs", _LENS_NUMBERS, file)
        lenses[: len(own)] = own[: len(lenses)]
    place = file.parent / "rgb"
    paths = find_photographs([str(index) for index in range(len(poses))], (place,), file, progress, guess_suffix=True)
    found = [(index, path) for index, path in enumerate(paths) if path is not None]
    found = sharpest(found, [path for _, path in found], most, "frames", progress)
    photographs = []
    for index, path in found:
        lens = Lens(width, height, *lenses[index].tolist())
        where = f"{file}, poses[{index}]"
        pose = pose_of(poses[index, :4], poses[index, 4:], where, "Export the recording again.") @ GL_FROM_CV
        photographs.append(Photograph(path.name, path, lens, pose, where))
    return with_unique_names(photographs)


def lidar_depth(file: Path) -> SensorDepth | None:
    """The recording's depth maps, if they lie beside its ``metadata.json``: EXR in metres, of the frames' names."""
    folder = file.parent / "depth"
    return SensorDepth(folder, range_m=LIDAR_RANGE_M) if folder.is_dir() else None


def _numbers(data: dict[str, Any], key: str, count: int, file: Path) -> np.ndarray:
    """(n, count) float64: the rows of numbers under ``key``."""
    try:
        rows = np.array(data[key], np.float64)
        if rows.ndim != 2 or rows.shape[1] != count or not len(rows) or not np.isfinite(rows).all():
            raise ValueError
    except (LookupError, TypeError, ValueError) as error:
        raise CaptureError(
            f"'{key}' holds no rows of {count} numbers", where=file, cure="Export the recording again as EXR and JPG."
        ) from error
    return rows

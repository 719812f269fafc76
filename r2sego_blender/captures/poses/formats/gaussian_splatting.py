"""``cameras.json`` that the original 3D Gaussian splatting writes beside every model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....config.settings import CaptureSettings
from ....core.progress import Progress
from ..pose_format import Posed, PoseFormat, json_files

if TYPE_CHECKING:
    import numpy as np

_POINTS = "input.ply"


def find(place: Path) -> list[Path]:
    """The file, or the one in a folder."""
    return json_files(place, ("cameras.json",), _holds, damaged=False)


def read(file: Path, folder: Path, settings: CaptureSettings, progress: Progress) -> Posed:
    """See ``gaussian_splatting``; the unit is unknown."""
    from ..gaussian_splatting import read_cameras_of_model

    return Posed(read_cameras_of_model(file, folder, progress), FORMAT.name)


def points(file: Path, progress: Progress) -> tuple[np.ndarray, np.ndarray] | None:
    """The points that the model began with, which it keeps beside the file."""
    from ..ply_points import read_ply_points

    place = file.parent / _POINTS
    return read_ply_points(place) if place.is_file() else None


def _holds(data: Any) -> bool:
    return isinstance(data, list) and any(isinstance(one, dict) and "rotation" in one for one in data)


FORMAT = PoseFormat("cameras.json of 3DGS", find, read, points, order=4)

"""``transforms.json`` of nerfstudio and instant-ngp."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ....config.settings import CaptureSettings
from ....core.printable import printable
from ....core.progress import Progress
from ..json_fields import read_json
from ..pose_format import Posed, PoseFormat, json_files

if TYPE_CHECKING:
    import numpy as np

_FILES, _KEY = ("transforms.json", "transforms_train.json"), "frames"


def find(place: Path) -> list[Path]:
    """The file, or the one in a folder."""
    return json_files(place, _FILES, _KEY)


def read(file: Path, folder: Path, settings: CaptureSettings, progress: Progress) -> Posed:
    """See ``transforms_json``; the unit is unknown unless the file says otherwise."""
    from ..transforms_json import read_transforms_json

    photographs, metric = read_transforms_json(file, folder, progress)
    masks = sum("mask_path" in frame for frame in read_json(file)["frames"])
    return Posed(photographs, FORMAT.name, metric, masks=masks)


def points(file: Path, progress: Progress) -> tuple[np.ndarray, np.ndarray] | None:
    """The points that nerfstudio puts beside the file, in the frame of its poses."""
    from ..finding import find_beside
    from ..ply_points import read_ply_points

    name = read_json(file).get("ply_file_path")
    if not isinstance(name, str):
        return None
    place = find_beside(name, (file.parent,))
    if place is not None:
        return read_ply_points(place)
    progress.message(f"the points '{printable(name)}' of {file} are missing", level="warning")
    return None


FORMAT = PoseFormat("transforms.json", find, read, points, _FILES, key=_KEY, order=3)

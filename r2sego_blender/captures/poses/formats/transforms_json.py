"""``transforms.json`` of nerfstudio and instant-ngp."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....config.settings import CaptureSettings
from ....core.printable import printable
from ....core.progress import Progress
from ..json_fields import number, read_json
from ..pose_format import Posed, PoseFormat, json_files

if TYPE_CHECKING:
    import numpy as np

_FILES = ("transforms.json", "transforms_train.json")
_OF_A_FRAME = ("file_path", "transform_matrix")


def find(place: Path) -> list[Path]:
    """The file, or the one in a folder."""
    return json_files(place, _FILES, _holds)


def read(file: Path, folder: Path, settings: CaptureSettings, progress: Progress) -> Posed:
    """See ``transforms_json``; the unit is unknown unless the file says otherwise, or names depth maps."""
    from ...sensors.sensor_depth import SensorDepth
    from ..transforms_json import kept_frames, read_transforms_json

    photographs, metric = read_transforms_json(file, folder, progress)
    frames = kept_frames(data := read_json(file), file).values()
    masks, named = (sum(key in frame for frame in frames) for key in ("mask_path", "depth_file_path"))
    maps = {one.name: one.depth_path for one in photographs if one.depth_path is not None}
    if named > len(maps):
        progress.message(
            f"{named - len(maps)} of the {named} depth maps that {file} names are missing", level="warning"
        )
    # nerfstudio's whole numbers are millimetres unless it is said
    unit_m = number("depth_unit_scale_factor", file, "", data, default=0.001, positive=True)
    depth = SensorDepth(file.parent, unit_m=unit_m, files=maps) if maps else None
    return Posed(photographs, FORMAT.name, metric, depth=depth, masks=masks)


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


def _holds(data: Any) -> bool:
    """Whether it has frames, of which sdfstudio's are none: their fields have other names."""
    frames = data.get("frames") if isinstance(data, dict) else None
    if not isinstance(frames, list) or not frames:
        return isinstance(data, dict) and "frames" in data
    return any(key in frame for frame in frames if isinstance(frame, dict) for key in _OF_A_FRAME)


FORMAT = PoseFormat("transforms.json", find, read, points, _FILES, order=3)

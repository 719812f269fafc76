"""Exports of Record3D: frames, their cameras and LiDAR depth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ....config.settings import CaptureSettings
from ....core.progress import Progress
from ..pose_format import Posed, PoseFormat, json_files

_FILES = ("metadata.json",)


def find(place: Path) -> list[Path]:
    """The ``metadata.json`` at or in a folder, or in its ``EXR_RGBD``."""
    inside = place / "EXR_RGBD"
    return json_files(inside if inside.is_dir() else place, _FILES, _holds, damaged=False)


def read(file: Path, folder: Path, settings: CaptureSettings, progress: Progress) -> Posed:
    """See ``record3d``; metric, with the LiDAR's depth where it is there."""
    from ..record3d import lidar_depth, read_record3d

    photographs = read_record3d(file, settings.max_keyframes, progress)
    return Posed(photographs, "Record3D, ARKit's poses as recorded", metric=True, depth=lidar_depth(file))


def _holds(data: Any) -> bool:
    return isinstance(data, dict) and {"poses", "K", "w", "h"} <= set(data)


FORMAT = PoseFormat("export of Record3D", find, read, files=_FILES, photographs_too=True, order=5)

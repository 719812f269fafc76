"""Exports of 3D Scanner App (All Data): photographs, their cameras and LiDAR depth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ....config.settings import CaptureSettings
from ....core.progress import Progress
from ..pose_format import Posed, PoseFormat, json_files


def find(place: Path) -> list[Path]:
    """An export, at its own folder."""
    names = sorted(file.name for file in place.glob("frame_*.json")) if place.is_dir() else []
    return [place] if json_files(place, names[:1], _holds, damaged=False) else []


def read(place: Path, folder: Path, settings: CaptureSettings, progress: Progress) -> Posed:
    """See ``three_d_scanner_app``; metric, with gravity, and the LiDAR's depth where it is there."""
    from ..polycam import UP
    from ..three_d_scanner_app import lidar_depth, read_three_d_scanner_app
    from ..trajectories import thinned

    photographs = thinned(read_three_d_scanner_app(place), settings.max_keyframes, progress)
    source = "3D Scanner App, ARKit's poses as recorded"
    return Posed(photographs, source, metric=True, up=UP, depth=lidar_depth(photographs))


def _holds(data: Any) -> bool:
    return isinstance(data, dict) and {"cameraPoseARFrame", "intrinsics"} <= set(data)


FORMAT = PoseFormat("export of 3D Scanner App", find, read, photographs_too=True, order=9)

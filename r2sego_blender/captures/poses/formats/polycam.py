"""Raw exports of Polycam: a folder ``keyframes`` of photographs and their cameras."""

from __future__ import annotations

from pathlib import Path

from ....config.settings import CaptureSettings
from ....core.progress import Progress
from ..pose_format import Posed, PoseFormat


def find(place: Path) -> list[Path]:
    """The ``keyframes`` in or at a folder."""
    return [folder for folder in (place / "keyframes", place) if _holds_cameras(folder)][:1]


def read(keyframes: Path, folder: Path, settings: CaptureSettings, progress: Progress) -> Posed:
    """See ``polycam``; metric, with gravity, and the LiDAR's depth where it is there."""
    from ..polycam import UP, lidar_depth, read_polycam

    photographs, source = read_polycam(keyframes, settings.max_keyframes, progress)
    return Posed(photographs, source, metric=True, up=UP, depth=lidar_depth(keyframes))


def _holds_cameras(keyframes: Path) -> bool:
    return any(
        all((keyframes / f"{kind}{name}").is_dir() for name in ("cameras", "images")) for kind in ("corrected_", "")
    )


FORMAT = PoseFormat("raw export of Polycam", find, read, photographs_too=True, order=1)

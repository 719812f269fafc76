"""Recordings of Stray Scanner: a video, its frames' poses and LiDAR depth."""

from __future__ import annotations

from pathlib import Path

from ....config.settings import CaptureSettings
from ....core.progress import Progress
from ..pose_format import Posed, PoseFormat

_FILES = ("odometry.csv",)
_BEGINS = "timestamp,frame,x,y,z,qx,qy,qz,qw"


def find(place: Path) -> list[Path]:
    """The ``odometry.csv`` at a file or in a folder."""
    file = place / _FILES[0] if place.is_dir() else place
    return [file] if _begins_so(file) else []


def read(odometry: Path, folder: Path, settings: CaptureSettings, progress: Progress) -> Posed:
    """See ``stray_scanner``; metric, with gravity, and the LiDAR's depth where it is there."""
    from ..polycam import UP, lidar_depth  # both are ARKit's
    from ..stray_scanner import read_stray_scanner
    from ..trajectories import thinned

    photographs = thinned(read_stray_scanner(odometry, folder), settings.max_keyframes, progress)
    source = "Stray Scanner, ARKit's poses as recorded"
    return Posed(photographs, source, metric=True, up=UP, depth=lidar_depth(odometry.parent))


def video(odometry: Path) -> Path:
    """The recording's video, there or not."""
    return odometry.with_name("rgb.mp4")


def _begins_so(file: Path) -> bool:
    if file.suffix.lower() != ".csv":
        return False
    try:
        with file.open("rb") as stream:
            return stream.read(200).replace(b" ", b"").startswith(_BEGINS.encode())
    except OSError:
        return False


FORMAT = PoseFormat("recording of Stray Scanner", find, read, files=_FILES, photographs_too=True, video=video, order=8)

"""Rendered walks through Replica: ``traj_w_c.txt`` of Semantic-NeRF's release, ``traj.txt`` of NICE-SLAM's."""

from __future__ import annotations

from pathlib import Path

from ....config.settings import CaptureSettings
from ....core.progress import Progress
from ..pose_format import Posed, PoseFormat

SEMANTIC_NERF, NICE_SLAM = "traj_w_c.txt", "traj.txt"
"""The files of poses."""

FRAMES = {SEMANTIC_NERF: "rgb", NICE_SLAM: "results"}
"""With the folder of frames beside each."""


def find(place: Path) -> list[Path]:
    """The file, or the one in a folder, where frames lie beside it."""
    files = [place / name for name in FRAMES] if place.is_dir() else [place]
    files = [file for file in files if file.name in FRAMES and file.is_file()]
    return [file for file in files if (file.parent / FRAMES[file.name]).is_dir()][:1]


def read(file: Path, folder: Path, settings: CaptureSettings, progress: Progress) -> Posed:
    """See ``replica``; metric. The depth beside the frames is the model's own, and stays out."""
    from ..replica import read_walk
    from ..trajectories import thinned

    photographs = thinned(read_walk(file), settings.max_keyframes, progress)
    return Posed(photographs, FORMAT.name, metric=True)


FORMAT = PoseFormat("walk through Replica", find, read, files=tuple(FRAMES), photographs_too=True, order=6)

"""Rendered walks through Replica: ``traj_w_c.txt`` of Semantic-NeRF's release, ``traj.txt`` of NICE-SLAM's."""

from __future__ import annotations

from pathlib import Path

from ....config.settings import CaptureSettings
from ....core.progress import Progress
from ..pose_format import Posed, PoseFormat
from ..replica_files import FRAMES, find_walk


def read(file: Path, folder: Path, settings: CaptureSettings, progress: Progress) -> Posed:
    """See ``replica``; metric. The depth beside the frames is the model's own, and stays out."""
    from ..replica import read_walk
    from ..trajectories import thinned

    photographs = thinned(read_walk(file), settings.max_keyframes, progress)
    return Posed(photographs, FORMAT.name, metric=True)


FORMAT = PoseFormat("walk through Replica", find_walk, read, files=tuple(FRAMES), photographs_too=True, order=6)

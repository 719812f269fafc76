"""Files of rendered walks through Replica found, in the layouts of Semantic-NeRF's and NICE-SLAM's releases."""

from __future__ import annotations

from pathlib import Path

SEMANTIC_NERF, NICE_SLAM = "traj_w_c.txt", "traj.txt"
"""The files of poses."""

FRAMES = {SEMANTIC_NERF: ("rgb", "rgb_"), NICE_SLAM: ("results", "frame")}
"""By the file of poses, the folder of frames beside it and how their names begin."""


def find_walk(place: Path) -> list[Path]:
    """The file of poses, or the one in a folder, where a folder of frames lies beside it."""
    files = [place / name for name in FRAMES] if place.is_dir() else [place]
    files = [file for file in files if file.name in FRAMES and file.is_file()]
    return [file for file in files if (file.parent / FRAMES[file.name][0]).is_dir()][:1]

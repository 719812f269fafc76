"""7-Scenes (Shotton et al. 2013): sequences of a Kinect, some to learn from and some held out."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ....captures.poses.seven_scenes import RANGE_M, depth_of, frames_in, posed_frame, sequences
from ....captures.poses.seven_scenes_files import TEST, TRAIN
from ....core.progress import Progress
from ..dataset import Dataset, Split
from ..splits import equally_spaced

_CAPTURES = 10
_MOST_FROZEN = 60
"""Of test sequences with thousands of frames, each like its neighbours."""


def scenes(data: Path) -> Mapping[str, Path]:
    """The folders with both lists of sequences in a folder, or the folder itself."""
    folders = [data, *sorted(path for path in data.iterdir() if path.is_dir())] if data.is_dir() else []
    return {one.name: one for one in folders if all((one / name).is_file() for name in (TRAIN, TEST))}


def split(place: Path, name: str, count: int, progress: Progress) -> Split:
    """Captures of the training sequences, one after the other, and held-out frames of the test sequences."""
    learnt, held_out = ([frame for one in sequences(place, part) for frame in frames_in(one)] for part in (TRAIN, TEST))
    captures = [posed_frame(one) for one in equally_spaced(learnt, count, place, "frames to learn from")]
    kept = equally_spaced(held_out, min(_MOST_FROZEN, len(held_out)), place)
    return Split(
        captures,
        [posed_frame(one) for one in kept],
        f"captures equally spaced over the {len(learnt)} frames of {TRAIN}, {len(kept)} held-out ones over the "
        f"{len(held_out)} of {TEST}",
        depth_of(captures),
        RANGE_M,
    )


DATASET = Dataset(
    "7scenes", "seq-01/frame-000000.color.png with .pose.txt, and lists of sequences", _CAPTURES, scenes, split
)
"""7-Scenes."""

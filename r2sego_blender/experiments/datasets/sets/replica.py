"""Replica (Straub et al. 2019), as others rendered it: walks of Semantic-NeRF and NICE-SLAM, and folders with a split.

Six captures and the frames around them are those of GuidedVD-3DGS (Zhong et al. 2025), which later papers took over.
Poses are the model's, in metres, wherever they stand; its depth and semantics are never read.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ....captures.poses.photographs import Photograph
from ....captures.poses.replica import read_walk
from ....captures.poses.replica_files import SEMANTIC_NERF, find_walk
from ....captures.poses.trajectories import read_matrices
from ....core.errors import ExperimentError
from ....core.progress import Progress
from ..colmap_split import holds_split, read_split
from ..dataset import Dataset, Published, PublishedScore, Split
from ..splits import around, equally_spaced

_SIX = 6
_WALK, _REACH, _STEP = 900, 50, 10
"""Frames of a walk of Semantic-NeRF, and the held-out ones' distance from a capture and from each other."""

_PUBLISHED_WALKS = {
    "office_2": ("Sequence_2", (244, 291, 436, 607, 760, 831)),
    "office_3": ("Sequence_1", (22, 98, 315, 504, 581, 731)),
    "office_4": ("Sequence_2", (233, 305, 440, 555, 759, 806)),
    "room_0": ("Sequence_2", (5, 80, 187, 392, 497, 658)),
    "room_1": ("Sequence_1", (17, 39, 125, 349, 449, 840)),
    "room_2": ("Sequence_1", (61, 178, 323, 485, 526, 758)),
}
"""Of each scene in the published protocol the walk, and the frames that are captures."""

_ROOMS = {
    f"{kind}{number}": f"{kind}_{number}" for kind, most in (("office", 5), ("room", 3)) for number in range(most)
}
"""By NICE-SLAM's names Semantic-NeRF's, which tables have."""


def scenes(data: Path) -> Mapping[str, Path]:
    """The scenes of either layout in a folder, or the one that it is."""
    folders = sorted(path for path in data.iterdir() if path.is_dir()) if data.is_dir() else []
    found = {_name(one): one for one in folders if _walks(one) or holds_split(one)}
    return found or ({_name(data): data} if _walks(data) or holds_split(data) else {})


def split(place: Path, name: str, count: int, progress: Progress) -> Split:
    """A folder's own split, the published one of a walk, or one by the same rule."""
    if holds_split(place):
        captures, frozen = read_split(place, progress)
        told = f"of the folder's own split {count} of {len(captures)} captures, equally spaced"
        told = "the folder's own split" if len(captures) == count else told
        return Split(equally_spaced(captures, count, place, "photographs to learn from"), frozen, told)
    walks = _walks(place)
    sequence, published = _PUBLISHED_WALKS.get(name, ("", ()))
    file = walks.get(sequence) or next(iter(walks.values()))
    frames, length = {_number(one): one for one in read_walk(file)}, len(read_matrices(file))
    if count == _SIX and published and file.name == SEMANTIC_NERF and length == _WALK:
        captures_at = list(published)
        told = "captures and held-out frames of GuidedVD-3DGS"
    else:
        captures_at = equally_spaced(list(frames), count, file, "frames")
        told = "equally spaced captures, and held-out frames around them by the rule of GuidedVD-3DGS"
    # In a longer walk the same share of it.
    reach, step = max(1, round(length * _REACH / _WALK)), max(1, round(length * _STEP / _WALK))
    held_out = [number for number in around(captures_at, length, reach, step) if number in frames]
    if missing := [number for number in captures_at if number not in frames]:
        cure = "Give all frames of the walk."
        raise ExperimentError(f"frame {missing[0]} of the scene {name} is not there", where=file, cure=cure)
    numbers = ", ".join(map(str, captures_at))
    return Split(
        [frames[number] for number in captures_at],
        [frames[number] for number in held_out],
        f"{told}; captures are the frames {numbers} of {file.parent.name}",
    )


def _walks(place: Path) -> dict[str, Path]:
    """The files of poses in a scene's folder and its sequences, by the sequence, empty where there is one walk."""
    own = find_walk(place)
    inside = sorted(place.glob("Sequence_*")) if place.is_dir() else []
    return {"": own[0]} if own else {one.name: found[0] for one in inside if (found := find_walk(one))}


def _number(frame: Photograph) -> int:
    return int("".join(filter(str.isdigit, Path(frame.name).stem)))


def _name(folder: Path) -> str:
    return _ROOMS.get(folder.name, folder.name)


DATASET = Dataset(
    "replica",
    "rgb/rgb_0.png with traj_w_c.txt, results/frame000000.jpg with traj.txt, or COLMAP folders with a split",
    _SIX,
    scenes,
    split,
    Published(
        "means over Replica",
        _SIX,
        "GaMO (Huang et al., arXiv:2512.25073); all on an RTX 4090",
        (
            PublishedScore("3DGS with DUSt3R points", 24.74, 0.862),
            PublishedScore("FSGS", 23.91, 0.846),
            PublishedScore("InstantSplat", 23.09, 0.849),
            PublishedScore("Difix3D+", 21.86, 0.811),
            PublishedScore("GenFusion", 23.98, 0.855),
            PublishedScore("GuidedVD-3DGS", 26.68, 0.880),
            PublishedScore("GaMO", 26.40, 0.882),
        ),
    ),
)
"""Replica."""

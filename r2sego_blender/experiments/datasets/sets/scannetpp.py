"""ScanNet++ (Yeshwanth et al. 2023): photographs of a fisheye lens, with the set's own held-out ones."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ....captures.poses.photographs import Photograph
from ....captures.poses.transforms_json import read_transforms_json
from ....core.errors import ExperimentError
from ....core.file_names import caseless
from ....core.progress import Progress
from ..colmap_split import LISTS, read_lists
from ..dataset import Dataset, Split
from ..splits import equally_spaced

_CAPTURES = 10
_POSES = "dslr/nerfstudio/transforms.json"
_UNDISTORTED = "dslr/nerfstudio/transforms_undistorted.json"
_IMAGES = {
    _UNDISTORTED: ("dslr/undistorted_images", "dslr/resized_undistorted_images"),
    _POSES: ("dslr/resized_images",),
}
"""The folders of photographs by their poses; first what the set's own program undistorted, on which others score."""


def scenes(data: Path) -> Mapping[str, Path]:
    """The scenes in a folder, or in ``data`` there, or the one that it is."""
    folders = [data, *data.glob("*"), *data.glob("data/*")] if data.is_dir() else []
    return {one.name: one for one in sorted(folders) if _photographs_of(one) is not None}


def split(place: Path, name: str, count: int, progress: Progress) -> Split:
    """Captures of the photographs to learn from, in the order of their names, and all that are held out."""
    found = _photographs_of(place)
    assert found is not None  # scenes has looked
    file, images = found
    learnt = {_plain(one.name): one for one in read_transforms_json(file, images, progress)[0]}
    held_out = {_plain(one.name): one for one in read_transforms_json(file, images, progress, held_out=True)[0]}
    told = f"the held-out photographs of {file.name}"
    if (place / "dslr" / LISTS).is_file():
        known = learnt | held_out
        train, test = ([known[key] for name in names if (key := _plain(name)) in known] for names in _lists(place))
        told = f"the split of dslr/{LISTS}"
    else:
        train, test = list(learnt.values()), [one for key, one in held_out.items() if key not in learnt]
    if not test:
        raise ExperimentError(
            f"the scene {name} has no held-out photographs",
            where=place,
            cure="Take a scene of the training or validation set: of others they are kept back.",
        )
    captures = equally_spaced(_ordered(train), count, place, "photographs to learn from")
    return Split(captures, _ordered(test), f"captures equally spaced over {len(train)} photographs, {told}")


def _photographs_of(place: Path) -> tuple[Path, Path] | None:
    """The poses of a scene and the folder of their photographs, where both are there."""
    found = ((place / poses, place / folder) for poses, folders in _IMAGES.items() for folder in folders)
    return next((one for one in found if one[0].is_file() and one[1].is_dir()), None)


def _lists(place: Path) -> tuple[list[str], list[str]]:
    return read_lists(place / "dslr" / LISTS)


def _ordered(photographs: list[Photograph]) -> list[Photograph]:
    return sorted(photographs, key=lambda one: one.name)


def _plain(name: str) -> str:
    return caseless(Path(name).name)


DATASET = Dataset(
    "scannetpp", "dslr/nerfstudio/transforms.json with test_frames or train_test_lists.json", _CAPTURES, scenes, split
)
"""ScanNet++."""

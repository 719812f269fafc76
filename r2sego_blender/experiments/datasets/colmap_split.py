"""Folders of photographs with COLMAP models that say which of them are to learn from and which are held out.

As sparse-view methods pass them on: models and photographs apart (``sparse/0`` of ``images``, ``sparse/test`` of
``images_test``, as GaMO has them), or one model with lists of names (``train.txt`` and ``test.txt`` in the folder or in
``sparse/0``, where 3DGS looks for the second; or ``train_test_lists.json``, as ScanNet++ has it).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from ...captures.poses.colmap_files import model_suffix
from ...captures.poses.colmap_model import read_colmap_model
from ...captures.poses.json_fields import read_json
from ...captures.poses.photographs import Photograph
from ...captures.poses.trajectories import lines_of
from ...core.errors import ExperimentError
from ...core.file_names import caseless
from ...core.progress import Progress

_MODEL, _TEST_MODEL = "sparse/0", "sparse/test"
_IMAGES, _TEST_IMAGES = "images", "images_test"
LISTS = "train_test_lists.json"
"""The file of names, as ScanNet++ calls it."""

_TRAIN, _TEST = "train.txt", "test.txt"
_MOST_BYTES = 4 << 20


def holds_split(folder: Path) -> bool:
    """Whether a folder has a model, photographs, and says which are held out."""
    if model_suffix(folder / _MODEL) is None or not (folder / _IMAGES).is_dir():
        return False
    return _is_apart(folder) or (folder / LISTS).is_file() or _list_in(folder, _TEST) is not None


def read_split(folder: Path, progress: Progress) -> tuple[list[Photograph], list[Photograph]]:
    """The photographs to learn from and those that are held out, each by name, in the models' frame.

    Where only those held out are listed, all others are to learn from. Raises CaptureError, and ExperimentError for a
    name that the model has not.
    """
    learnt = read_colmap_model(folder / _MODEL, folder / _IMAGES, progress)
    if _is_apart(folder):
        return _by_name(learnt), _by_name(read_colmap_model(folder / _TEST_MODEL, folder / _TEST_IMAGES, progress))
    train, test, where = _lists(folder)
    held_out = _of_names(learnt, test, where)
    others = [one for one in learnt if one not in held_out]
    return _by_name(_of_names(learnt, train, where) if train is not None else others), _by_name(held_out)


def read_lists(file: Path) -> tuple[list[str], list[str]]:
    """Names under ``train`` and ``test`` of a ``train_test_lists.json``. Raises ExperimentError and CaptureError."""
    data = read_json(file)
    found = [data.get(key) for key in ("train", "test")]
    for key, names in zip(("train", "test"), found, strict=True):
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise ExperimentError(f"'{key}' is no list of names", where=file, cure="Copy the file again.")
    return found[0] or [], found[1] or []


def _lists(folder: Path) -> tuple[list[str] | None, list[str], Path]:
    """Names to learn from, None for all others, those that are held out, and where they are listed."""
    if (folder / LISTS).is_file():
        return *read_lists(folder / LISTS), folder / LISTS
    test, train = _list_in(folder, _TEST), _list_in(folder, _TRAIN)
    assert test is not None  # holds_split has looked
    return None if train is None else _names_in(train), _names_in(test), test


def _is_apart(folder: Path) -> bool:
    return model_suffix(folder / _TEST_MODEL) is not None and (folder / _TEST_IMAGES).is_dir()


def _list_in(folder: Path, name: str) -> Path | None:
    return next((one for one in (folder / name, folder / _MODEL / name) if one.is_file()), None)


def _names_in(file: Path) -> list[str]:
    lines = (line.strip() for line in lines_of(file, _MOST_BYTES))
    return [line for line in lines if line and not line.startswith("#")]


def _of_names(photographs: Sequence[Photograph], names: Iterable[str], where: Path) -> list[Photograph]:
    """Those of these names, which may lack their folder or suffix."""
    known = {_plain(key): one for one in photographs for key in (Path(one.name).stem, one.name)}
    found = {name: known.get(_plain(name)) or known.get(_plain(Path(name.replace("\\", "/")).name)) for name in names}
    if missing := [name for name, one in found.items() if one is None]:
        cure = "Take it out of the list, or add its photograph and pose."
        raise ExperimentError(f"'{missing[0]}' is listed, and has no photograph with a pose", where=where, cure=cure)
    return list({one.name: one for one in found.values() if one is not None}.values())


def _plain(name: str) -> str:
    return caseless(name.replace("\\", "/"))


def _by_name(photographs: Sequence[Photograph]) -> list[Photograph]:
    return sorted(photographs, key=lambda one: (len(one.name), one.name))

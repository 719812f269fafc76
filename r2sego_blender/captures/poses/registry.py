"""Poses found at a place, of whatever kind in ``formats``. Blender's Python reads it too."""

from __future__ import annotations

import contextlib
import importlib
import pkgutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from ...core.errors import CaptureError
from . import formats
from .json_fields import read_json
from .pose_format import PoseFormat

PHOTOGRAPHS = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".webp", ".avif", ".heic", ".heif")
"""Suffixes of photographs, in small letters."""


def _records() -> tuple[PoseFormat, ...]:
    modules = [module.name for module in pkgutil.iter_modules(formats.__path__)]
    found = [importlib.import_module(f".{name}", formats.__name__).FORMAT for name in modules]
    return tuple(sorted(found, key=lambda record: record.order))


FORMATS = _records()
"""Every kind, in the order in which they are looked for."""


def find_poses(place: Path) -> tuple[PoseFormat, Path]:
    """The poses at a file or in a folder, and their kind.

    Raises CaptureError where there are none, or several to choose from.
    """
    for record in FORMATS:
        if found := record.find(place):
            return record, only_one(found, place)
    names = [record.name for record in FORMATS]
    known = f"{', '.join(names[:-1])} or {names[-1]}"
    if place.is_dir() or is_part(place):
        raise CaptureError(
            f"there is no {known} in this folder",
            where=place if place.is_dir() else place.parent,
            cure="Give the folder that holds them, see docs/formats.md.",
        )
    cure = f"Give a {known} (docs/formats.md): most programs that solve poses export one of these."
    if place.suffix.lower() == ".json" or not place.is_file():
        read_json(place, cure)  # says that it is missing, or what is wrong
    raise CaptureError("the file is of no kind of poses that is read", where=place, cure=cure)


def find_export(folder: Path) -> tuple[PoseFormat, Path] | None:
    """The poses in a folder whose own photographs they are of, and their kind.

    Those of an export; or of any kind where no photograph lies straight in the folder, for they name those below.
    Raises CaptureError where there are several to choose from.
    """
    exports = [record for record in FORMATS if record.photographs_too]
    for record in exports if has_photographs(folder) else (*exports, *_files_first()):
        if found := record.find(folder):
            return record, only_one(found, folder)
    return None


def find_recording(place: Path, poses: Path | None = None) -> tuple[Path, Path] | None:
    """The video and the poses of its frames, of a recording that has both; None for anything else.

    ``place`` is the recording's folder or its video; ``poses`` are looked for there unless they are given.
    """
    folder = place.parent if place.is_file() else place
    for record in FORMATS:
        if record.video is None:
            continue
        for found in record.find(folder if poses is None else poses):
            video = record.video(found)
            given = video if place.is_file() else video.parent
            if video.is_file() and place.exists() and place.samefile(given):
                return video, found
    return None


def poses_beside(folder: Path) -> Sequence[Path]:
    """The poses that lie in a folder of photographs, those of a file before others; () where none do."""
    return next((found for record in _files_first() if (found := record.find(folder))), ())


def poses_near(folder: Path) -> Sequence[Path]:
    """The poses of every kind in a folder of photographs, else in the one that it lies in; () where none lie.

    In the system's folder of temporary files lies what is anybody's: frames of a video are taken there.
    """
    above = folder.resolve().parent
    for place in (folder,) if above == Path(tempfile.gettempdir()).resolve() else (folder, above):
        with contextlib.suppress(PermissionError):  # above lies what is others'
            if found := [poses for record in _files_first() for poses in record.find(place)]:
                return found
    return ()


def poses_unpacked(folder: Path) -> Path | None:
    """The poses in an unpacked archive, in which nobody can name them; None where it brings its own anyway, or none.

    Raises CaptureError where there are several to choose from.
    """
    if not folder.is_dir() or find_export(folder) is not None or find_recording(folder) is not None:
        return None
    found = poses_beside(folder)
    return only_one(found, folder) if found else None


def has_photographs(folder: Path) -> bool:
    """Whether photographs lie straight in a folder, by their names."""
    return folder.is_dir() and any(map(is_photograph, folder.iterdir()))


def is_photograph(file: Path) -> bool:
    """Whether a file is a photograph, by its name."""
    return file.suffix.lower() in PHOTOGRAPHS and not file.name.startswith(".")


def _files_first() -> Sequence[PoseFormat]:
    return sorted(FORMATS, key=lambda record: not record.files)


def only_one(found: Sequence[Path], folder: Path) -> Path:
    """The poses that were found in a folder. Raises CaptureError where there are several."""
    if len(found) > 1:
        raise CaptureError(
            f"there are {len(found)} models",
            where=folder,
            cure=f"Name the one to use, such as {found[0]}; each is a room of its own.",
        )
    return found[0]


def is_part(file: Path) -> bool:
    """Whether a file of this name is one of those whose folder is the poses."""
    return any(file.name in record.parts for record in FORMATS)


def is_pose_file(file: Path) -> bool:
    """Whether a file of this name is poses."""
    return any(file.name in record.files for record in FORMATS)

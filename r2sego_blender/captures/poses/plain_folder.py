"""What lies in a folder of plain photographs: taken, or passed over and said."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from operator import attrgetter
from pathlib import Path

from ...core.errors import CaptureError
from ...core.images import image_files
from ...core.progress import Progress
from .dropped_files import VIDEOS
from .photographs import MIN_CAPTURES, is_depth_map, listed, require_name, require_readable, too_few
from .registry import poses_near

_RAW = frozenset({".dng", ".raw", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".rw2", ".orf", ".pef", ".srw"})
UNREAD_PICTURES = _RAW | {".jxl", ".gif", ".jp2", ".psd", ".exr", ".hdr"}
"""Suffixes of pictures that are no photographs here, in small letters."""

_NAME = attrgetter("name")  # paths themselves are sorted otherwise on Windows


def plain_photographs(folder: Path, progress: Progress) -> list[Path]:
    """The photographs straight inside ``folder``, each once, sorted by name.

    Pictures of a kind that is not read, depth maps and copies of a photograph, and poses that lie
    beside them or in the folder above are told. Raises CaptureError for files that are no images, and when
    fewer than three photographs are left: it says where others may be.
    """
    files = image_files(folder)
    for path in files:
        require_name(path.name, folder)
    require_readable(files)  # an empty file is told now, not after those before it were worked on
    files, maps = _without_depth_maps(files)
    found, copies = distinct_photographs(files)
    passed = _passed_over(folder, found)
    if len(found) < MIN_CAPTURES:
        raise _too_few(folder, len(found), copies, passed)
    if maps:
        progress.message(f"{listed(maps)}: passed over, for they are depth maps (one channel of 16 bits or more)")
    tell_copies(copies, progress)
    if passed:
        progress.message(f"{listed(passed)}: passed over. {_cure(passed)}", level="warning")
    for poses in poses_near(folder):
        progress.message(f"{poses} is not read: `--poses {poses}` takes these in place of solving", level="warning")
    return found


def _without_depth_maps(paths: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """The photographs and the depth maps beside them; alone such pictures are photographs."""
    maps: list[Path] = []
    others: list[Path] = []
    for path in paths:
        (maps if is_depth_map(path) else others).append(path)
    return (others, maps) if others else (maps, [])


def distinct_photographs(paths: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """The files without those of the same bytes as one of a shorter name, and these, by name."""
    known: set[bytes] = set()
    copies: set[Path] = set()
    for path in sorted(paths, key=lambda path: (len(path.name), path.name)):  # "IMG_1 (1).jpg" is the copy
        digest = hashlib.sha256(path.read_bytes()).digest()
        if digest in known:
            copies.add(path)
        known.add(digest)
    return [path for path in paths if path not in copies], sorted(copies, key=_NAME)


def tell_copies(copies: Sequence[Path], progress: Progress) -> None:
    """Warn of photographs that are left out as copies of others, if there are any."""
    if copies:
        progress.message(f"{listed(copies)}: the same photograph again, left out", level="warning")


def _passed_over(folder: Path, found: Sequence[Path]) -> list[Path]:
    """Pictures and videos that are not read and of which no readable one has the name.

    A phone may write IMG_1.DNG, IMG_1.HEIC and IMG_1.MOV of one moment.
    """
    files = [path for path in folder.iterdir() if not path.name.startswith(".") and path.is_file()]
    pictures = [path for path in files if path.suffix.lower() in UNREAD_PICTURES]
    videos = [path for path in files if path.suffix.lower() in VIDEOS]
    known = {path.stem.lower() for path in found}
    pictures = [path for path in pictures if path.stem.lower() not in known]
    known |= {path.stem.lower() for path in pictures}
    videos = [path for path in videos if path.stem.lower() not in known]
    return sorted(pictures, key=_NAME) + sorted(videos, key=_NAME)


def _too_few(folder: Path, count: int, copies: list[Path], passed: list[Path]) -> CaptureError:
    error = too_few(count, folder)
    if passed:
        return CaptureError(f"{error.what}; {listed(passed)} cannot be read", where=folder, cure=_cure(passed))
    rooms = sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))
    rooms = [path for path in rooms if _looks_like_photographs(image_files(path))]
    if rooms:
        poses = next(iter(poses_near(folder)), None)
        cure = "Give that folder." if poses is None else f"Give that folder, and `--poses {poses}` with it."
        return CaptureError(f"{error.what}; there are some in {listed(rooms)}", where=folder, cure=cure)
    if copies:
        return CaptureError(f"{error.what}; {listed(copies)} are the same again", where=folder, cure=error.cure)
    return error


def _looks_like_photographs(files: Sequence[Path]) -> bool:
    """Whether these are enough; the first is looked at, for there may be thousands."""
    try:
        return len(files) >= MIN_CAPTURES and not is_depth_map(files[0])
    except CaptureError:  # it is told once its folder is given
        return True


def _cure(passed: Sequence[Path]) -> str:
    suffixes = {path.suffix.lower() for path in passed}
    cures = []
    if suffixes - set(VIDEOS):
        cures.append("Save them as JPEG, PNG or TIFF.")
    if suffixes & set(VIDEOS):
        cures.append("Give a video itself in place of the folder, and its frames are taken.")
    return " ".join(cures)

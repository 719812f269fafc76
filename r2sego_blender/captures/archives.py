"""Zip archives as phones share scans and photographs: unpacked into a folder, within bounds."""

from __future__ import annotations

import contextlib
import shutil
import stat
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path, PurePosixPath

from ..core.errors import CaptureError, R2SEgoError
from ..core.progress import Progress
from ..core.text_files import open_zip, opened_file
from .poses.dropped_files import ARCHIVES, VIDEOS

_MOST_BYTES = 64 << 30
_MOST_TIMES = 50  # photographs and videos are compressed already, depth and text by some ten times
_ALWAYS_BYTES = 64 << 20
_MOST_FILES = 100_000
_MOST_LIST_BYTES = 32 << 20
_PIECE_BYTES = 4 << 20
_UNPACK = "Unpack the archive where a file in it has to be named or changed."
_CURE = "Save or share it again, or unpack it and give the folder."


def is_archive(path: Path) -> bool:
    """Whether this is a file that is called as an archive."""
    return path.suffix.lower() in ARCHIVES and path.is_file()


def unpack(archive: Path, folder: Path, progress: Progress) -> Path:
    """Unpack an archive into an empty folder; the innermost folder in it that holds all there is, or its one video.

    What a Mac puts beside its files is passed over, and so are links. Raises CaptureError for what is no archive,
    is damaged or encrypted, has names that lead out of it, or is far larger than photographs can be packed into.
    """
    try:
        with opened_file(archive) as stream, open_zip(stream, _MOST_LIST_BYTES) as opened:
            _unpack(archive, opened, folder, progress)
    except CaptureError:
        raise
    except Exception as error:  # zipfile, zlib, lzma and bz2 raise their own
        raise _refused(archive, f"it cannot be unpacked ({error})") from error
    inside = folder
    while inside.is_dir() and len(places := list(inside.iterdir())) == 1:
        if not (places[0].is_dir() or places[0].suffix.lower() in VIDEOS):
            break
        inside = places[0]
    return inside


@contextlib.contextmanager
def naming(archive: Path, folder: Path, progress: Progress) -> Iterator[Progress]:
    """A progress for work on what was unpacked into ``folder``, which nobody knows: what is told through it, and
    errors that are raised within, name the archive in its place.

    What errors ask to do in there takes unpacking it.
    """

    def named(text: str) -> str:
        return text.replace(str(folder), str(archive))

    try:
        yield _Renamed(progress, named)
    except R2SEgoError as error:
        where = None if error.where is None else named(error.where)
        cure = named(error.cure)
        if (where, cure) != (error.where, error.cure):
            cure = f"{cure} {_UNPACK}"
        raise type(error)(named(error.what), where=where, cure=cure) from error


class _Renamed(Progress):
    """A progress whose messages are ``named``."""

    def __init__(self, progress: Progress, named: Callable[[str], str]) -> None:
        self._progress, self._named = progress, named
        self.task, self.picture = progress.task, progress.picture  # type: ignore[method-assign]

    def message(self, text: str, level: str = "info") -> None:
        self._progress.message(self._named(text), level)


def _unpack(archive: Path, opened: zipfile.ZipFile, folder: Path, progress: Progress) -> None:
    members = [member for member in opened.infolist() if not member.is_dir() and not _passed_over(member)]
    total = sum(member.file_size for member in members)
    packed = archive.stat().st_size
    if len(members) > _MOST_FILES or total > min(_MOST_BYTES, max(_ALWAYS_BYTES, _MOST_TIMES * packed)):
        raise _refused(archive, f"{packed} bytes hold {len(members)} files of {total} bytes")
    if total > shutil.disk_usage(folder).free:
        raise CaptureError(
            f"there is no space for its {total} bytes", where=folder, cure="Free some, or set TMPDIR to another disk."
        )
    with progress.task("Unpacking", max(total, 1)) as task:
        for member in members:
            place = folder / _inside(archive, member.filename)
            place.parent.mkdir(parents=True, exist_ok=True)
            with opened.open(member) as source, place.open("xb") as target:
                while piece := source.read(_PIECE_BYTES):
                    target.write(piece)
                    task.advance(len(piece))


def _passed_over(member: zipfile.ZipInfo) -> bool:
    name = PurePosixPath(member.filename)
    return "__MACOSX" in name.parts or name.name == ".DS_Store" or stat.S_ISLNK(member.external_attr >> 16)


def _inside(archive: Path, name: str) -> PurePosixPath:
    path = PurePosixPath(name.replace("\\", "/"))
    if path.is_absolute() or ".." in path.parts or ":" in name or not path.parts:
        raise _refused(archive, "it has names that lead out of it")
    return path


def _refused(archive: Path, why: str) -> CaptureError:
    return CaptureError(f"this archive is not taken: {why}", where=archive, cure=_CURE)

"""Files and folders that a reader sees whole or not at all. Needs the standard library alone."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

from .json_files import read_json
from .scratch import keeping, scratch_place
from .text_files import write_text

UNFINISHED = ".unfinished-"
"""How the names begin of what is not in its place yet."""

CHANGES = ".changes"
"""The folder of what takes its place together, once all of it is written."""

_PARTS = "parts.json"
_OLD = f"{UNFINISHED}old-"
_PLACES = ("", "*/", "*/*/")
"""Where a bundle has what is published: at its top, as in ``geometry/``, as in ``rounds/0/``."""
_FEW_FILES = 64
"""Up to this many files are flushed one by one; beyond, the whole system once is quicker."""

_PAUSES_S = [0.01 * 2**n for n in range(8)] if os.name == "nt" else []
"""On Windows a virus scanner or an indexer may hold a new file for a moment; then it lets go."""


def unwritable(folder: Path) -> str:
    """Why no file can be made in a folder, "" where one can: to be told before long work, not after it."""
    try:
        with tempfile.TemporaryFile(dir=folder):
            return ""
    except OSError as error:
        return error.strerror or str(error)


def write_whole(file: Path, text: str) -> None:
    """Write ``text`` beside ``file``, have the disk take it, and put it in its place."""
    with made_whole(file) as unfinished:
        write_text(unfinished, text)


@contextlib.contextmanager
def made_whole(file: Path) -> Iterator[Path]:
    """Where to write what becomes ``file`` on leaving without an error, once the disk has taken it."""
    unfinished = file.with_name(UNFINISHED + file.name)  # hidden: no digest of a folder has it
    yield unfinished
    flush(unfinished)
    rename(unfinished, file)


@contextlib.contextmanager
def replacing_together(folder: Path, parts: Collection[str]) -> Iterator[Path]:
    """A new folder to write ``parts`` in, files and folders of ``folder`` by their names there.

    On leaving without an error those that were written take their places. Killed before
    that, nothing has changed; killed within, ``finish_replacing`` does the rest.
    """
    staging = folder / f"{UNFINISHED}changes"
    remove(staging)
    staging.mkdir()
    try:
        with scratch_place(staging):
            yield staging
            write_text(staging / _PARTS, json.dumps(list(parts)))
            flush(staging)
            with keeping(staging):
                rename(staging, folder / CHANGES)  # from here on they count
        finish_replacing(folder, parts)
    finally:
        remove(staging)


def finish_replacing(folder: Path, parts: Collection[str]) -> bool:
    """Put in place what ``replacing_together`` had written of ``parts`` when it was killed; whether it had.

    What ``swap_in`` had put aside in ``folder``, or in one of those within, when it was killed is put
    back, whoever called it; other folders that are not in their places go. Nobody else may be writing.
    Raises ValueError where it is said to be of other parts: then nobody's ``replacing_together`` wrote it.
    """
    for where in _PLACES:
        for left in list(folder.glob(f"{where}{UNFINISHED}*")):
            place = left.with_name(left.name.removeprefix(_OLD))
            if left.name.startswith(_OLD) and not place.exists():
                rename(left, place)
            elif left.is_dir():  # files are written again, and those of others may be on their way
                with contextlib.suppress(OSError):  # what cannot go disturbs nobody
                    remove(left)
    changes = folder / CHANGES
    if not (changes / _PARTS).is_file():
        remove(changes)
        return False
    written = read_json(changes / _PARTS)
    if not (isinstance(written, list) and all(isinstance(part, str) and part in parts for part in written)):
        raise ValueError(f"{CHANGES}/{_PARTS} names what is never replaced")
    for part in written:
        if (changes / part).exists():
            (folder / part).parent.mkdir(parents=True, exist_ok=True)
            swap_in(changes / part, folder / part)
    (changes / _PARTS).unlink()
    remove(changes)
    return True


def is_replacing(folder: Path) -> bool:
    """Whether ``replacing_together`` is putting things in their places, or was killed as it did."""
    return (folder / CHANGES / _PARTS).is_file()


def flush(path: Path) -> None:
    """Have the disk take a file, or a folder with all in it."""
    files = [path, *path.rglob("*")] if path.is_dir() else [path]
    if len(files) > _FEW_FILES and hasattr(os, "sync"):
        os.sync()
        return
    for file in files:
        if file.is_dir() and os.name == "nt":  # Windows cannot flush folders
            continue
        descriptor = os.open(file, os.O_RDONLY if os.name != "nt" else os.O_RDWR)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def swap_in(made: Path, place: Path) -> None:
    """Rename ``made`` to ``place``, which may be there, a folder too."""
    if made.is_dir() and place.exists():
        old = place.with_name(f"{_OLD}{place.name}")
        remove(old)
        rename(place, old)
        rename(made, place)
        remove(old)
    else:
        rename(made, place)


def rename(made: Path, place: Path) -> None:
    """Rename ``made`` to ``place``, in place of a file that is there; waits for who holds it for a moment."""
    _patiently(lambda: made.replace(place))


def linked(source: str | Path, place: str | Path) -> None:
    """A file at another place, never to be written into: a hard link where the disk has them, else a copy."""
    try:
        os.link(source, place)
    except OSError:
        shutil.copy2(source, place)


def remove(path: Path) -> None:
    """Remove a file, a link or a folder with all in it, if it is there."""
    if path.is_dir() and not path.is_symlink():
        _patiently(lambda: shutil.rmtree(path))
    else:
        _patiently(lambda: path.unlink(missing_ok=True))


def _patiently(change: Callable[[], object]) -> None:
    """Call ``change`` until nobody holds the file any more, or for as long as a virus scanner may."""
    for pause_s in _PAUSES_S:
        try:
            change()
            return
        except OSError as error:  # a folder is not empty while one of its removed files is still held
            if error.errno not in (errno.EACCES, errno.ENOTEMPTY):
                raise
        time.sleep(pause_s)
    change()

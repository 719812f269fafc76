"""What a file or folder holds, told by a digest."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from pathlib import Path

_HIDDEN = ("desktop.ini", "thumbs.db")  # Windows hides these without a dot
_WHOLE_BYTES, _END_BYTES = 1 << 26, 1 << 20


def content_digest(path: Path) -> str:
    """A SHA-256 over a file's bytes, or over a folder's names and bytes; '' when it is missing.

    Hidden files, such as a file manager's ``.DS_Store`` or ``Thumbs.db``, are none of a folder's. Raises
    OSError for what may not be read, which is not the same as nothing.
    """
    digest = hashlib.sha256()
    if path.is_dir():
        names = [file.relative_to(path) for file in _files(path)]
        for name in sorted(names, key=lambda name: name.parts):  # Windows compares paths in small letters
            digest.update(name.as_posix().encode())
            digest.update(content_digest(path / name).encode())
    elif path.is_file():
        with path.open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256")
    else:
        return ""
    return digest.hexdigest()


def file_identity(path: Path) -> str:
    """What tells a file from another in a moment: its digest, or the size and both ends of a large one.

    Plans are made often, and reading weights of gigabytes takes longer than many a step. Torch ends its
    files with a checksum of every tensor, so their last MiB changes with any. Raises OSError where it cannot
    be read.
    """
    size = path.stat().st_size
    if size <= _WHOLE_BYTES:
        return content_digest(path)
    with path.open("rb") as stream:
        digest = hashlib.sha256(stream.read(_END_BYTES))
        stream.seek(size - _END_BYTES)
        digest.update(stream.read())
    return f"{size} {digest.hexdigest()}"


def _files(folder: Path) -> Iterator[Path]:
    """The files within that are not hidden; ``rglob`` would pass over what may not be listed."""
    for where, folders, names in os.walk(folder, onerror=_raise):
        folders[:] = [name for name in folders if not _is_hidden(name)]
        for name in names:
            if not _is_hidden(name) and name.lower() not in _HIDDEN and (file := Path(where, name)).is_file():
                yield file


def _is_hidden(name: str) -> bool:
    return name.startswith(".")


def _raise(error: OSError) -> None:
    raise error

"""What a file or folder holds, told by a digest."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from pathlib import Path

_HIDDEN = ("desktop.ini", "thumbs.db")  # Windows hides these without a dot
_WHOLE_BYTES, _END_BYTES, _BLOCK_BYTES = 1 << 26, 1 << 20, 1 << 20


def content_digest(path: Path) -> str:
    """A SHA-256 over a file's bytes, or over a folder's names and bytes; '' when it is missing.

    Hidden files, such as a file manager's ``.DS_Store`` or ``Thumbs.db``, are none of a folder's. Raises
    OSError for what may not be read, which is not the same as nothing.
    """
    if path.is_dir():
        digest = hashlib.sha256()
        for parts, file in sorted(_files(path)):  # not by their paths: Windows compares them in small letters
            digest.update("/".join(parts).encode())
            digest.update(_file_digest(file).encode())
        return digest.hexdigest()
    return _file_digest(path) if path.is_file() else ""


def _file_digest(path: Path) -> str:
    try:
        with path.open("rb") as stream:
            # As many bytes as it says that it has: some of the system's files say none, and never end.
            digest, left = hashlib.sha256(), os.fstat(stream.fileno()).st_size
            while block := stream.read(min(left, _BLOCK_BYTES)):
                digest.update(block)
                left -= len(block)
            return digest.hexdigest()
    except FileNotFoundError:  # deleted since it was listed
        return ""


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


def _files(folder: Path) -> Iterator[tuple[tuple[str, ...], Path]]:
    """The names below ``folder`` of each file within that is not hidden, and its path; ``rglob`` would pass over
    what may not be listed."""
    for where, folders, names in os.walk(folder, onerror=_raise):
        folders[:] = [name for name in folders if not _is_hidden(name)]
        below = Path(where).relative_to(folder).parts
        for name in names:
            file = Path(where, name)
            if not _is_hidden(name) and name.lower() not in _HIDDEN and file.is_file():
                yield (*below, name), file


def _is_hidden(name: str) -> bool:
    return name.startswith(".")


def _raise(error: OSError) -> None:
    raise error

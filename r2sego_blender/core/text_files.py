"""Text files as a bundle holds them: UTF-8, their lines ended alike by every system.

A step that ran on Windows then leaves the bytes, and so the digests, that it leaves elsewhere. Needs
the standard library alone.
"""

from __future__ import annotations

import contextlib
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import IO


def write_text(file: Path, text: str) -> None:
    """Write ``text`` as ``file``."""
    file.write_text(text, encoding="utf-8", newline="\n")


@contextlib.contextmanager
def opened_file(file: Path) -> Iterator[IO[bytes]]:
    """A file to read that is one: a pipe or a device would never end. Raises OSError and ValueError."""
    with open(file, "rb", opener=_without_waiting) as stream:
        if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
            raise ValueError("it is no file, but a pipe or a device")
        yield stream


def read_bytes(file: Path, most_bytes: int) -> bytes:
    """The bytes of a file of at most so many. Raises OSError, and ValueError for a larger one."""
    with opened_file(file) as stream:
        size = os.fstat(stream.fileno()).st_size
        if size > most_bytes:
            raise ValueError(f"it has {size} bytes, of at most {most_bytes}")
        return stream.read(size)  # what it is told to read it takes memory for first


def read_text(file: Path, most_bytes: int) -> str:
    """The UTF-8 text of a file of at most so many bytes. Raises as ``read_bytes``, and ValueError for none."""
    return read_bytes(file, most_bytes).decode("utf-8-sig")


def _without_waiting(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))

"""Text files as a bundle holds them: UTF-8, their lines ended alike by every system; and files of others, opened.

A step that ran on Windows then leaves the bytes, and so the digests, that it leaves elsewhere. Needs
the standard library alone.
"""

from __future__ import annotations

import contextlib
import os
import stat
import struct
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO

_LONGEST_COMMENT = 1 << 16
_END_BYTES, _LOCATOR_BYTES, _RECORD_BYTES = 22, 20, 56  # of the end of the list of files, and of zip64's


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


def read_lines(file: Path, most_bytes: int, most_lines: int) -> list[str]:
    """The lines of a file that may be cut off anywhere, or hold what is no UTF-8.

    Raises as ``read_bytes``, and ValueError for more lines: they take many times their bytes.
    """
    content = read_bytes(file, most_bytes)
    if content.count(b"\n") > most_lines:
        raise ValueError(f"it has more than {most_lines} lines")
    return content.decode(errors="replace").split("\n")


def open_zip(stream: IO[bytes], most_list_bytes: int) -> zipfile.ZipFile:
    """The archive in ``stream``. Raises ``zipfile.BadZipFile`` for none, and for a list of files of more bytes.

    ``zipfile`` makes an object of half a kilobyte of each of the 46 bytes that a listed file may take.
    """
    size = _list_bytes(stream)
    if size > most_list_bytes:
        raise zipfile.BadZipFile(f"its list of files has {size} bytes")
    return zipfile.ZipFile(stream)


def _list_bytes(stream: IO[bytes]) -> int:
    """The bytes of the list of files, as any of Python's versions finds them."""
    size = stream.seek(0, 2)
    begin = max(0, size - _LONGEST_COMMENT - _END_BYTES - _LOCATOR_BYTES)
    stream.seek(begin)
    end = stream.read()
    place = end.rfind(b"PK\5\6")
    if place < 0 or place + _END_BYTES > len(end):
        raise zipfile.BadZipFile("it is no zip archive, or cut short")
    (told,) = struct.unpack_from("<I", end, place + 12)
    locator = end[max(0, place - _LOCATOR_BYTES) : place]
    if not locator.startswith(b"PK\6\7"):
        return int(told)
    (record,) = struct.unpack_from("<Q", locator, 8)
    sizes: list[int] = []
    # zipfile goes by zip64's record, whatever stands behind it: where it is told, or straight before this.
    for start in {min(record, size), max(0, begin + place - _LOCATOR_BYTES - _RECORD_BYTES)}:
        stream.seek(start)
        head = stream.read(_RECORD_BYTES)
        if len(head) == _RECORD_BYTES and head.startswith(b"PK\6\6"):
            sizes += struct.unpack_from("<Q", head, 40)
    return max(sizes, default=int(told))


def _without_waiting(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))

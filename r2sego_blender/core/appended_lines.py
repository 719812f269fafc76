"""Files of lines that several writers may append to, as an index of what was recorded.

A line goes in one write, so that those of two writers do not mix. Needs the standard library alone.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

_FLAGS = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


def append_line(file: Path, line: str, to_disk: bool = False) -> None:
    """Append ``line`` on a line of its own, and have the disk take it where asked to.

    Raises OSError, also for a link, a pipe or a device, which a folder from elsewhere may hold.
    """
    descriptor = os.open(file, os.O_RDWR | os.O_APPEND | os.O_CREAT | _FLAGS, 0o666)
    try:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise OSError(f"{file.name} is no file, but a pipe or a device")
        start = ""
        if status.st_size:
            os.lseek(descriptor, -1, os.SEEK_END)
            start = "" if os.read(descriptor, 1) == b"\n" else "\n"  # a cut-off line ends there
        os.write(descriptor, f"{start}{line}\n".encode())
        if to_disk:
            os.fsync(descriptor)
    finally:
        os.close(descriptor)

"""Whether a reader reaches beyond its input: writes elsewhere, opens what it is not to see, or a socket."""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_WRITES = {"os.remove", "os.rename", "os.rmdir", "os.mkdir", "os.link", "os.symlink", "os.truncate", "shutil.rmtree"}
_NETWORK = {"socket.connect", "socket.getaddrinfo", "socket.sendto", "urllib.Request"}
_CODE = {"os.system", "os.exec", "os.posix_spawn"}
_seen: list[str] | None = None
_own = ""
_installed = False


@contextlib.contextmanager
def watched(own: Path) -> Iterator[list[str]]:
    """What reaches out while the ``with`` lasts, in words; ``own`` is the folder of what is read."""
    global _seen, _own, _installed
    if not _installed:
        sys.addaudithook(_hear)
        _installed = True
    found: list[str] = []
    _seen, _own = found, os.path.realpath(own) + os.sep
    try:
        yield found
    finally:
        _seen = None


def _hear(event: str, arguments: tuple[Any, ...]) -> None:
    if _seen is None:
        return
    if event == "open":
        path, _, flags = arguments
        if not isinstance(path, str | bytes):
            return
        place = os.fsdecode(path)
        if "outside/secret" in place and not os.path.realpath(place).startswith(_own):
            _seen.append(f"opens {place}")
        elif isinstance(flags, int) and flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT) and not _is_own(place):
            _seen.append(f"writes {place}")
    elif event in _WRITES:
        place = os.fsdecode(arguments[0]) if isinstance(arguments[0], str | bytes | os.PathLike) else ""
        # Names in an open folder are of those that are removed whole.
        if place.startswith("/") and not _is_own(place):
            _seen.append(f"{event} {place}")
    elif event in _CODE or (event in _NETWORK and "127.0.0.1" not in str(arguments)):
        _seen.append(f"{event} {str(arguments)[:100]}")


def _is_own(place: str) -> bool:
    """Whether a file is this process's scratch, a device, or what Python and Numba keep of compiled code."""
    whole = os.path.realpath(place)
    scratch = os.path.realpath(tempfile.gettempdir())
    return whole.startswith((scratch, "/dev/", "/proc/")) or "__pycache__" in whole or "numba" in whole.lower()

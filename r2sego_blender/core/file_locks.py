"""A lock on a file that the system drops when the process ends, however it ends."""

from __future__ import annotations

import errno
import math
import sys
import time
from typing import IO

from .errors import SceneError

_PAUSE_S = 0.2


def try_lock(file: IO) -> bool:
    """Lock an open file for this process alone; whether it was free.

    Raises SceneError where the disk knows no locks, as some network disks.
    """
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.EAGAIN, errno.EWOULDBLOCK, errno.EACCES):
            return False
        raise SceneError(
            f"this disk cannot lock a file: {error.strerror}",
            where=file.name,
            cure="Work on a disk of this machine, or have the network disk mounted with locks.",
        ) from error
    return True


def wait_for_lock(file: IO, patience_s: float = math.inf) -> bool:
    """As ``try_lock``, waiting so long for whoever holds the lock; whether it came free."""
    until_s = time.monotonic() + patience_s
    while not try_lock(file):
        if time.monotonic() >= until_s:
            return False
        time.sleep(_PAUSE_S)
    return True

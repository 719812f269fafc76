"""A lock on a file that the system drops when the process ends, however it ends."""

from __future__ import annotations

import errno
import sys
from typing import IO

from .errors import SceneError


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

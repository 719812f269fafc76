"""The lock of a bundle: one thread of one process writes to it at a time."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator
from pathlib import Path

from ..core.atomic_files import finish_replacing
from ..core.errors import SceneError
from ..core.file_locks import try_lock
from .disk import disk_errors

LOCK = ".lock"
"""The file in the bundle."""

_HOLDERS: dict[Path, int] = {}  # of bundles that this process holds: the thread


@contextlib.contextmanager
def locked(bundle: Path) -> Iterator[None]:
    """Hold ``bundle`` for writing; the thread that holds it may do so again.

    Raises SceneError when another process or thread holds it, and after finishing what was cut off.
    """
    key, thread = bundle.resolve(), threading.get_ident()
    if _HOLDERS.get(key) == thread:
        yield
        return
    with disk_errors(bundle, kept=""):
        lock = (bundle / LOCK).open("a+")
    with lock as file:
        if not try_lock(file):
            raise SceneError(
                "another process is working on this scene", where=bundle, cure="Wait until it has ended, or cancel it."
            )
        if finish_replacing(bundle):  # whoever holds the lock has read what was there before
            raise SceneError("a correction had been cut off, and is finished now", where=bundle, cure="Start again.")
        _HOLDERS[key] = thread
        try:
            yield
        finally:
            del _HOLDERS[key]


def held_still(bundle: Path) -> contextlib.AbstractContextManager[None]:
    """Keep others from writing while results that belong together are read; as ``locked``.

    A bundle that may only be read, as published ones, is read without its lock.
    """
    lock = bundle / LOCK
    writable = os.access(lock if lock.exists() else bundle, os.W_OK)
    return locked(bundle) if writable else contextlib.nullcontext()

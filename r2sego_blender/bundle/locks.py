"""The lock of a bundle: one thread of one process writes to it at a time."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ..core.atomic_files import CHANGES, finish_replacing
from ..core.errors import SceneError
from ..core.file_locks import wait_for_lock
from .containment import require_contained
from .disk import disk_errors
from .layout import DECLARATION, IN_WORLD_FRAME

LOCK = ".lock"
"""The file in the bundle."""

CORRECTED_TOGETHER = (*IN_WORLD_FRAME, DECLARATION)
"""What a correction of the world frame replaces, which the next who holds the lock may have to finish."""


@dataclass(frozen=True)
class _Holder:
    """Who holds a bundle: the thread, and the lock's file, which is there as long as the bundle is."""

    thread: int
    lock: os.stat_result


_HOLDERS: dict[Path, _Holder] = {}  # of bundles that this process holds


@contextlib.contextmanager
def locked(bundle: Path, patience_s: float = 0.0) -> Iterator[None]:
    """Hold ``bundle`` for writing; the thread that holds it may do so again.

    Raises SceneError when another process or thread holds it, waited for so long, and after finishing what was cut off.
    """
    key, thread = bundle.resolve(), threading.get_ident()
    if key in _HOLDERS and _HOLDERS[key].thread == thread:
        yield
        return
    require_contained(bundle)
    with disk_errors(bundle, kept=""):
        lock = (bundle / LOCK).open("a+")
    with lock as file:
        if not wait_for_lock(file, patience_s):
            raise SceneError(
                "another process is working on this scene", where=bundle, cure="Wait until it has ended, or cancel it."
            )
        if _finish_correction(bundle):  # whoever holds the lock has read what was there before
            raise SceneError("a correction had been cut off, and is finished now", where=bundle, cure="Start again.")
        _HOLDERS[key] = _Holder(thread, os.fstat(file.fileno()))
        try:
            yield
        finally:
            del _HOLDERS[key]


def require_there(bundle: Path) -> None:
    """Raises SceneError where ``bundle`` was removed, or replaced by another, since this process holds it.

    Else what is published next would make a stub of a bundle, or spoil another.
    """
    holder = _HOLDERS.get(bundle.resolve())
    try:
        there = bundle.is_dir() if holder is None else os.path.samestat((bundle / LOCK).stat(), holder.lock)
    except FileNotFoundError:
        there = False
    if not there:
        raise SceneError(
            "the bundle was removed or replaced while it was worked on",
            where=bundle,
            cure="Nothing more is written to it; start again where it is now.",
        )


def _finish_correction(bundle: Path) -> bool:
    try:
        return finish_replacing(bundle, CORRECTED_TOGETHER)
    except ValueError as error:
        raise SceneError(
            f"a correction that was cut off cannot be finished: {error}",
            where=bundle / CHANGES,
            cure="Remove this folder: what it replaces is still there.",
        ) from error


def held_still(bundle: Path, patience_s: float = 0.0) -> contextlib.AbstractContextManager[None]:
    """Keep others from writing while results that belong together are read; as ``locked``.

    A bundle that may only be read, as published ones, is read without its lock.
    """
    lock = bundle / LOCK
    writable = os.access(lock if lock.exists() else bundle, os.W_OK)
    return locked(bundle, patience_s) if writable else contextlib.nullcontext()

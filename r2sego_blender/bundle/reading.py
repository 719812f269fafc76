"""A bundle read while a job may write to it: what was caught halfway is read again.

No lock is taken, so that nobody waits for a reader. Blender's Python reads so, too.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from ..core.atomic_files import is_replacing
from ..core.errors import R2SEgoError, SceneError
from .journal import JOURNAL
from .layout import DECLARATION
from .scene import Scene

_Read = TypeVar("_Read")

_PATIENCE_S, _PAUSE_S, _TRIES = 1.0, 0.05, 3


def read_beside_jobs(path: Path, read: Callable[[Scene], _Read]) -> _Read:
    """What ``read`` makes of the bundle ``path``, which is opened for it.

    A folder is gone for a moment as another takes its place, and a correction replaces several things
    after one another. What changed meanwhile or could not be read is read again: up to three times, and
    beyond that for a second. An error that comes twice of a bundle at rest is the reader's own.
    """
    until, tries, failed = time.monotonic() + _PATIENCE_S, 0, False
    while True:
        before, error = _state(path), None
        try:
            found = read(Scene.open(path))
        except (R2SEgoError, OSError) as raised:
            error = raised
        tries += 1
        is_half = is_replacing(path)
        at_rest = _state(path) == before and not is_half
        late = tries >= _TRIES and time.monotonic() >= until
        if error is None and (at_rest or late):
            return found
        if error is not None and (late or (at_rest and failed)):
            if not is_half:
                raise error
            raise SceneError(
                "a correction was cut off before all of it was in its place",
                where=path,
                cure="Run `r2sego refine`, which finishes it, and look again.",
            ) from error
        failed = error is not None
        time.sleep(_PAUSE_S)


def _state(path: Path) -> tuple[object, ...]:
    """What is another once something was published or declared."""
    files = (path / name for name in (JOURNAL, DECLARATION))
    stats = (file.stat() if file.is_file() else None for file in files)
    return tuple(stat and (stat.st_size, stat.st_mtime_ns, stat.st_ino) for stat in stats)

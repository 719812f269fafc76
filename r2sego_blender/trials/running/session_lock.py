"""One session at a time runs a study: the lock that it holds, which the system drops however it ends.

Standard library alone: Blender asks here before it tells a session anything.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from ...core.errors import TrialError
from ...core.file_locks import try_lock, wait_for_lock
from ...core.text_files import opened_file
from ..records.index import RECORDS_FOLDER

_LOCK_FILE = "session.lock"
_PATIENCE_S = 0.5  # ``is_run`` holds the lock for a moment to look


@contextlib.contextmanager
def alone(study: Path) -> Iterator[None]:
    """Within its ``with`` block no other session runs the study. Raises TrialError where one does."""
    folder = study / RECORDS_FOLDER
    folder.mkdir(exist_ok=True)
    with (folder / _LOCK_FILE).open("ab") as file:
        if not wait_for_lock(file, _PATIENCE_S):
            raise TrialError("another session runs this study", where=study, cure="End that one first.")
        yield


def is_run(study: Path) -> bool:
    """Whether a session runs the study, on this machine."""
    try:
        with opened_file(study / RECORDS_FOLDER / _LOCK_FILE) as file:
            return not try_lock(file)
    except (OSError, ValueError):
        return False

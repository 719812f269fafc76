"""A disk that is full, or that may not be written, as an error that says what to do."""

from __future__ import annotations

import contextlib
import errno
from collections.abc import Iterator
from pathlib import Path

from ..core.errors import SceneError


@contextlib.contextmanager
def disk_errors(place: Path, kept: str = ": finished steps are kept") -> Iterator[None]:
    """Inside it an OSError of a full or write-protected disk is a SceneError that names ``place``."""
    try:
        yield
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES):
            raise
        reason = "the disk is full" if error.errno in (errno.ENOSPC, errno.EDQUOT) else "it cannot be written"
        raise SceneError(
            reason, where=place, cure=f"Make room, allow writing, or close what has it open, then start again{kept}."
        ) from error

"""Frozen views: held-out photographs for scoring, which refinement never sees."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..core.errors import CaptureError
from .capture import Capture
from .lens_correction import brought_along
from .poses.cameras_json import read_frozen
from .poses.photographs import ANY_SIZE_PX, posed_captures


def load_frozen_views(
    path: Path, max_side_px: int = ANY_SIZE_PX, captures: Sequence[Capture] = ()
) -> tuple[Capture, ...]:
    """The ``frozen`` list of a ``cameras.json``, in the frame of that file.

    Intrinsics are an entry's own, those under ``frozen_intrinsics``, or the file's; where a lens of
    ``captures`` was corrected, views with its given intrinsics have the corrected one, too. Only
    evaluation may call this. Raises CaptureError when the list is missing, empty or
    names a file that is not there.
    """
    photographs = read_frozen(path, path.parent)
    if not photographs:
        raise CaptureError("the 'frozen' list is empty", where=path, cure="List held-out photographs.")
    views = posed_captures(photographs, max_side_px)
    return tuple(brought_along(view, captures) for view in views)

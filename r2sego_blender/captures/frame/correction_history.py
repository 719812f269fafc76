"""The corrections of a scene's registration that can be taken back. NumPy alone, for Blender too."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...bundle.frames import is_frame
from ...bundle.layout import CORRECTIONS
from ...core.cameras import is_similarity
from ...core.errors import CaptureError
from ...core.json_files import read_json

_REMEMBERED = {"new_from_old", "world_from_capture", "ground", "scale_source"}


def corrections_of(bundle: Path) -> list[dict[str, Any]]:
    """The corrections of a bundle so far, oldest first: the similarity, the registration before it, and
    the digests of what it made of each file that it moved.

    Raises CaptureError when the file is damaged.
    """
    file = bundle / CORRECTIONS
    if not file.is_file():
        return []
    try:
        history = read_json(file)
        if not isinstance(history, list) or not all(map(_is_whole, history)):
            raise ValueError("an entry is damaged")
    except (OSError, ValueError) as error:
        raise CaptureError(
            f"the corrections cannot be read: {error}",
            where=file,
            cure="Remove the file: the corrections are kept then.",
        ) from error
    return history


def _is_whole(one: Any) -> bool:
    """Whether a correction has all that taking it back needs; older bundles have no digests."""
    if not isinstance(one, dict) or not one.keys() >= _REMEMBERED or not isinstance(one.setdefault("made", {}), dict):
        return False
    if not isinstance(one["ground"], str) or not isinstance(one["scale_source"], str):
        return False
    matrices = one["new_from_old"], one["world_from_capture"]
    return all(is_frame(rows) and is_similarity(np.array(rows)) for rows in matrices)

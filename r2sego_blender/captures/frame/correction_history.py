"""The corrections of a scene's registration that can be taken back. NumPy alone, for Blender too."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from ...bundle.layout import CORRECTIONS
from ...core.errors import CaptureError

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
        history = json.loads(file.read_text(encoding="utf-8"))
        for one in history:
            whole = np.array(one["new_from_old"]).shape == (4, 4) and one.keys() >= _REMEMBERED
            if not (whole and isinstance(one.setdefault("made", {}), dict)):  # older bundles have none
                raise ValueError("an entry is damaged")
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise CaptureError(
            f"the corrections cannot be read: {error}",
            where=file,
            cure="Remove the file: the corrections are kept then.",
        ) from error
    return history

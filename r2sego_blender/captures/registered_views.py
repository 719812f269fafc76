"""Captures as a bundle registers them: photographs, and their cameras in the world. NumPy alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..bundle import layout
from ..bundle.artifacts import Artifact
from ..core.cameras import Camera
from ..core.errors import CaptureError
from ..core.json_files import opened_json
from ..core.printable import printable

CURE = "Make the scene anew with `r2sego new`."


@dataclass(frozen=True)
class RegisteredView:
    """A photograph of the bundle and its camera; ``entry`` is what else ``cameras.json`` says of it."""

    name: str
    image_path: Path
    camera: Camera
    entry: Mapping[str, Any]


def read_registered_views(folder: Path) -> tuple[RegisteredView, ...]:
    """What ``cameras.json`` lists, in its order. Raises CaptureError where it is damaged or lists nothing."""
    path = folder / "cameras.json"
    with opened_json(path, CaptureError, "the list of captures is damaged", CURE) as table:
        listed = list(table["captures"])
    views = []
    for index, entry in enumerate(listed):
        try:
            name, image_path = str(entry["name"]), folder / "images" / Path(entry["file"]).name
            if not name or printable(name, len(name)) != name:
                raise ValueError("its name has characters that cannot be shown")
            views.append(RegisteredView(name, image_path, Camera.from_json(entry), entry))
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            raise damaged_entry(path, index, error) from error
    if not views:
        raise CaptureError("'captures' is an empty list", where=path, cure=CURE)
    return tuple(views)


def damaged_entry(path: Path, index: int, error: Exception) -> CaptureError:
    """The error of one entry of ``cameras.json``."""
    return CaptureError(f"the entry is damaged ({error!r})", where=f"{path}, captures[{index}]", cure=CURE)


REGISTERED_VIEWS = Artifact(layout.CAPTURES, read_registered_views)
"""The captures as Blender reads them; the engine's are ``store.CAPTURES``."""

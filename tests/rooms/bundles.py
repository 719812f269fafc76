"""A bundle of what a test fills in."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from r2sego_blender.bundle.creating import create_bundle
from r2sego_blender.bundle.declaration import Declaration
from r2sego_blender.bundle.scene import Scene

IDENTITY = tuple(map(tuple, np.eye(4).tolist()))


def no_captures(folder: Path) -> None:
    """An empty folder for them."""
    (folder / "captures").mkdir()


def new_bundle(path: Path, fill: Callable[[Path], None] = no_captures, **declared: object) -> Scene:
    """The bundle ``path`` as ``fill`` fills it, of photographs in metres over a floor; or as ``declared``."""
    common = {
        "captures_source": "photographs",
        "world_from_capture": IDENTITY,
        "ground": "floor",
        "scale_source": "metric",
    }
    return create_bundle(path, Declaration(**common | declared), fill)

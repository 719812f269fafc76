"""COLMAP models: a folder with ``cameras`` and ``images`` files, text or binary."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ....config.settings import CaptureSettings
from ....core.progress import Progress
from ..colmap_files import COLMAP_FILES, find_models, model_suffix
from ..pose_format import Posed, PoseFormat

if TYPE_CHECKING:
    import numpy as np


def find(place: Path) -> list[Path]:
    """The models at a folder or one of their files."""
    if place.name in COLMAP_FILES and not place.is_dir():
        place = place.parent
    return find_models(place) if place.is_dir() else []


def read(model: Path, folder: Path, settings: CaptureSettings, progress: Progress) -> Posed:
    """See ``colmap_model``; the unit is unknown."""
    from ..colmap_model import read_colmap_model

    photographs = read_colmap_model(model, folder, progress)
    return Posed(photographs, FORMAT.name, lens_file=model / f"cameras{model_suffix(model)}")


def points(model: Path, progress: Progress) -> tuple[np.ndarray, np.ndarray] | None:
    """See ``colmap_points``."""
    from ..colmap_points import read_colmap_points

    return read_colmap_points(model)


FORMAT = PoseFormat("COLMAP model", find, read, points, parts=COLMAP_FILES, order=0)

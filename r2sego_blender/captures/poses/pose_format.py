"""What one kind of poses tells of itself: the record that each file in ``formats`` has as ``FORMAT``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...config.settings import CaptureSettings
from ...core.json_files import read_json
from ...core.progress import Progress

if TYPE_CHECKING:
    import numpy as np

    from ..sensors.sensor_depth import SensorDepth
    from .photographs import Photograph


@dataclass(frozen=True)
class Posed:
    """Photographs with their poses, in the frame of the poses.

    ``source`` says in words where the poses come from, ``metric`` whether they are known to be in metres;
    ``up`` (3,) is the direction up where the device measured gravity, ``depth`` what its depth sensor
    saw; ``masks`` counts the masks that are named, there or not. ``lens_file`` states the lenses, where it is
    not the poses themselves.
    """

    photographs: Sequence[Photograph]
    source: str
    metric: bool = False
    up: np.ndarray | None = None
    depth: SensorDepth | None = None
    masks: int = 0
    lens_file: Path | None = None


@dataclass(frozen=True)
class PoseFormat:
    """One kind of poses.

    ``name`` is what it is called for people. ``find`` gives the poses of this kind at a file or in a folder,
    as ``read`` takes them, none where there are none; it is cheap, and raises nothing. ``read`` is given
    these and the folder of photographs, and raises CaptureError. ``points`` gives the positions (P, 3)
    float64 and colours (P, 3) uint8 that come with the poses, in their frame, or None. ``files`` are names
    that its files have, ``parts`` those of files whose folder is the poses. ``photographs_too``: a folder of
    it holds its own photographs, and is taken without being asked for. ``video`` gives the video that poses, as
    ``find`` gives them, are of: ``read`` then finds its frames in the folder of photographs, as their sensor stored
    them, called by their number alone, from 0. Kinds of a lower ``order`` are looked for first.
    """

    name: str
    find: Callable[[Path], Sequence[Path]]
    read: Callable[[Path, Path, CaptureSettings, Progress], Posed]
    points: Callable[[Path, Progress], tuple[np.ndarray, np.ndarray] | None] | None = None
    files: Sequence[str] = ()
    parts: Sequence[str] = ()
    photographs_too: bool = False
    video: Callable[[Path], Path] | None = None
    order: int = 1000


def json_files(place: Path, names: Sequence[str], holds: Callable[[Any], bool], damaged: bool = True) -> list[Path]:
    """``place`` where it is a file of such JSON, or the first such of these names in it.

    In a folder one that is ``damaged`` counts too: who reads it says what is wrong.
    """
    if not place.is_dir():
        return [place] if _is_of(place, holds) else []
    files = (place / name for name in names)
    kept = (True, None) if damaged else (True,)
    return [file for file in files if file.is_file() and _is_of(file, holds) in kept][:1]


def _is_of(file: Path, holds: Callable[[Any], bool]) -> bool | None:
    """Whether the file is such JSON; None where it cannot be read."""
    try:
        data = read_json(file)
    except (OSError, ValueError):
        return None
    return holds(data)

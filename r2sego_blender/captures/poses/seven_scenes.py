"""Sequences of 7-Scenes (Shotton et al. 2013): ``frame-000000.color.png``, ``.depth.png`` and ``.pose.txt`` a frame.

Poses are camera to world, OpenCV axes, in metres. The set's page gives 585 px about (320, 240) of 640 x 480 for its
depth camera, to which the poses belong, and says that the colour camera was not calibrated to it: photographs are taken
to have that lens, as everyone who follows the page does. Depth is in millimetres, 65535 where there is none.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from ...core.errors import CaptureError
from ..lenses.lens import Lens
from .photographs import Photograph
from .seven_scenes_files import POSE, holds_frames
from .trajectories import lines_of, numbers_of

RANGE_M = 65.0
"""What is beyond is what the sensor did not measure: it is written as 65.535 m."""

_LENS = Lens(640, 480, 585.0, 585.0, 320.0, 240.0)
_COLOUR, _DEPTH = ".color.png", ".depth.png"
_MOST_BYTES = 1 << 16
_SEQUENCE = re.compile(r"(?:sequence|seq-?)?\s*(\d{1,4})", re.IGNORECASE)


def sequences(scene: Path, split: str) -> list[Path]:
    """The folders of the sequences that the file ``split`` of a scene lists, in its order. Raises CaptureError."""
    found = []
    for line in lines_of(scene / split, _MOST_BYTES):
        words = line.strip()
        if not words or words.startswith("#"):
            continue
        match = _SEQUENCE.fullmatch(words)
        if match is None:
            cure = "Give the file as the set has it: 'sequence1', a line each."
            raise CaptureError(f"'{words[:40]}' is no sequence", where=scene / split, cure=cure)
        folder = scene / f"seq-{int(match[1]):02d}"
        # The zips of some copies hold a folder of the same name.
        inner = folder / folder.name
        folder = inner if inner.is_dir() else folder
        if folder in found:
            raise CaptureError(f"'{words}' is listed twice", where=scene / split, cure="Keep one line of each.")
        found.append(folder)
    if missing := [folder.name for folder in found if not holds_frames(folder)]:
        cure = "Unpack its zip there."
        raise CaptureError(f"the sequence {missing[0]} has no frames", where=scene, cure=cure)
    return found


def frames_in(folder: Path) -> list[Path]:
    """The photographs of a sequence, in order."""
    found = [path for path in folder.glob(f"frame-*{_COLOUR}") if path.is_file()]
    return sorted(found, key=lambda path: path.name)


def posed_frame(frame: Path) -> Photograph:
    """A photograph with its pose, named after its sequence too, for all have the same frames. Raises CaptureError."""
    file = _beside(frame, POSE)
    pose = numbers_of(" ".join(lines_of(file, _MOST_BYTES)), str(file)).reshape(4, 4)
    return Photograph(f"{frame.parent.name}/{frame.name}", frame, _LENS, pose, str(file))


def depth_of(frames: Sequence[Photograph]) -> dict[str, Path]:
    """The sensor's maps of photographs by their names, of those that have one."""
    maps = {one.name: _beside(one.path, _DEPTH) for one in frames}
    return {name: file for name, file in maps.items() if file.is_file()}


def _beside(frame: Path, suffix: str) -> Path:
    return frame.with_name(frame.name.removesuffix(_COLOUR) + suffix)

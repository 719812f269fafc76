"""Recordings as numbered frames and a text of their poses: a camera-to-world matrix a line, OpenCV axes."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from ...core.errors import CaptureError, may_not_be_read
from ...core.images import image_files
from ...core.progress import SILENT, Progress
from ...core.text_files import read_text
from ..lenses.lens import Lens
from ..sharpness import sharpest
from .photographs import Photograph

_MOST_BYTES = 32 << 20
_NUMBERS = 16
_CURE = "Give it as its data set has it: sixteen numbers a frame."


def read_matrices(file: Path) -> np.ndarray:
    """The poses (n, 4, 4) float64 of a text with sixteen numbers a line, row by row; empty lines are none.

    Raises CaptureError for a line of anything else.
    """
    rows = [numbers_of(line, f"{file}, line {i + 1}") for i, line in enumerate(lines_of(file)) if line.strip()]
    return np.array(rows, np.float64).reshape(-1, 4, 4)


def lines_of(file: Path, most_bytes: int = _MOST_BYTES) -> list[str]:
    """The lines of a text that comes with photographs. Raises CaptureError."""
    try:
        return read_text(file, most_bytes).splitlines()
    except PermissionError as error:
        raise may_not_be_read(file, CaptureError) from error
    except (OSError, ValueError) as error:
        raise CaptureError(f"this text cannot be read ({error})", where=file, cure="Copy it again.") from error


def numbers_of(text: str, where: str) -> np.ndarray:
    """The sixteen numbers of a pose, (16,) float64. Raises CaptureError."""
    try:
        found = np.array(text.split(), np.float64)
    except ValueError:
        found = np.zeros(0)
    if found.shape != (_NUMBERS,) or not np.isfinite(found).all():
        raise CaptureError(f"there is no pose of {_NUMBERS} numbers", where=where, cure=_CURE)
    return found


def pose_of(quaternion: np.ndarray, place: np.ndarray, where: str, cure: str) -> np.ndarray:
    """The pose (4, 4) float64 that turns by ``quaternion`` (4,) as x, y, z, w, and moves to ``place`` (3,).

    Raises CaptureError where the quaternion's length is not about 1.
    """
    if not 0.5 < float(np.linalg.norm(quaternion)) < 2.0:
        raise CaptureError("the rotation is no quaternion", where=where, cure=cure)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_quat(quaternion).as_matrix(), place
    return pose


def numbered_frames(folder: Path, stem: str) -> Mapping[int, Path]:
    """The pictures of a folder that are called ``stem`` and a number, by that, in its order."""
    found = {path: re.fullmatch(rf"{re.escape(stem)}(\d{{1,9}})", path.stem) for path in image_files(folder)}
    numbers = {int(match[1]): path for path, match in found.items() if match is not None}
    return dict(sorted(numbers.items()))


def posed_frames(file: Path, frames: Mapping[int, Path], lens: Lens) -> list[Photograph]:
    """The frames with the poses that stand for their numbers in ``file``, in its unit; its first line is frame 0.

    Raises CaptureError where a frame has none.
    """
    poses = read_matrices(file)
    if beyond := [path for number, path in frames.items() if number >= len(poses)]:
        what = f"there are {len(poses)} poses, and {len(beyond)} of the frames are beyond, the first {beyond[0].name}"
        raise CaptureError(what, where=file, cure="Give the whole file, or take these frames out.")
    return [
        Photograph(path.name, path, lens, poses[number], f"{file}, line {number + 1}")
        for number, path in frames.items()
    ]


def thinned(photographs: Sequence[Photograph], most: int, progress: Progress = SILENT) -> list[Photograph]:
    """Of more than ``most`` of a recording the sharpest of each ``most``-th part, which is said."""
    return sharpest(photographs, [one.path for one in photographs], most, "frames", progress)

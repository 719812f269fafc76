"""Recordings of Stray Scanner (github.com/strayrobots/scanner, docs/format.md and the app's encoders).

``rgb.mp4``, ``odometry.csv`` with a pose a frame, ``camera_matrix.csv``, and LiDAR depth in whole millimetres and
confidence a frame, called by its number. The app turns ARKit's camera by half about x before it writes its quaternion,
so poses are camera to world with OpenCV axes, in ARKit's world: metres, +Y up. Newer versions write each frame's
``fx, fy, cx, cy`` too, in pixels of the video.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ...core.errors import CaptureError
from ..lenses.lens import Lens
from .photographs import Photograph, photograph_size, require_lens_of_size
from .trajectories import lines_of, numbered_frames, pose_of

_TURN, _PLACE = ("qx", "qy", "qz", "qw"), ("x", "y", "z")
_LENS = ("fx", "fy", "cx", "cy")
_MATRIX = "camera_matrix.csv"
_MOST_MATRIX_BYTES = 1 << 16
_NUMBER = re.compile(r"[0-9]{1,9}")
_CURE = "Copy the recording's folder from the phone again."


def read_stray_scanner(odometry: Path, folder: Path) -> list[Photograph]:
    """The frames in ``folder`` that are called by their number, with the poses of ``odometry.csv``, in metres.

    Raises CaptureError where there are none, a frame has no pose, or numbers are not what they should be.
    """
    frames = numbered_frames(folder, "")
    if not frames:
        raise CaptureError(
            "there are no frames called by their numbers, from 0",
            where=folder,
            cure="Make a bundle of the recording with `r2sego new`, which takes them from its video.",
        )
    rows = _rows(odometry)
    if beyond := [path.name for number, path in frames.items() if number not in rows]:
        what = f"{len(beyond)} of the {len(frames)} frames have no pose, the first {beyond[0]}"
        raise CaptureError(what, where=odometry, cure="Frames are numbered from 0; take those out that are not its.")
    of_all = None if "fx" in rows[next(iter(frames))] else _camera_matrix(odometry.with_name(_MATRIX))
    photographs = []
    for number, path in frames.items():
        row, where = rows[number], f"{odometry}, frame {number}"
        numbers = _numbers(row, _LENS, where) if of_all is None else of_all
        width, height, _ = photograph_size(path)
        pose = pose_of(_numbers(row, _TURN, where), _numbers(row, _PLACE, where), where, _CURE)
        photographs.append(Photograph(path.name, path, Lens(width, height, *numbers.tolist()), pose, where))
    require_lens_of_size(photographs[0].lens, odometry, ("width", "height"))
    return photographs


def _rows(odometry: Path) -> Mapping[int, Mapping[str, str]]:
    """The lines of ``odometry.csv`` by their frame's number, each by the names of its columns."""
    rows: dict[int, Mapping[str, str]] = {}
    try:
        for line, row in enumerate(csv.DictReader(lines_of(odometry), skipinitialspace=True), 2):
            number = (row.get("frame") or "").strip()
            if not _NUMBER.fullmatch(number) or int(number) in rows:
                where = f"{odometry}, line {line}"
                raise CaptureError(f"'frame' is {number[:20]!r}, no new number", where=where, cure=_CURE)
            rows[int(number)] = row
    except csv.Error as error:
        raise CaptureError(f"this is no table of poses ({error})", where=odometry, cure=_CURE) from error
    return rows


def _numbers(row: Mapping[str, str | None], names: Sequence[str], where: str) -> np.ndarray:
    """The finite numbers (n,) float64 in these columns."""
    try:
        found = np.array([float(row[name] or "") for name in names])
    except (LookupError, ValueError):
        found = np.array([np.nan])
    if not np.isfinite(found).all():
        raise CaptureError(f"{', '.join(names)} are no numbers", where=where, cure=_CURE)
    return found


def _camera_matrix(file: Path) -> np.ndarray:
    """``fx, fy, cx, cy`` (4,) of the recording."""
    try:
        matrix = np.array([line.split(",") for line in lines_of(file, _MOST_MATRIX_BYTES) if line.strip()], np.float64)
    except ValueError:
        matrix = np.zeros(0)
    if matrix.shape != (3, 3) or not np.isfinite(matrix).all():
        raise CaptureError("there is no matrix of 3 x 3 numbers", where=file, cure=_CURE)
    return matrix[[0, 1, 0, 1], [0, 1, 2, 2]]

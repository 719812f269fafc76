"""Importing photographs, with the poses somebody solved or with poses solved here."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..config.settings import CaptureSettings
from ..core.errors import CaptureError
from ..core.progress import SILENT, Progress
from .capture import Capture
from .poses import json_fields as fields
from .poses.cameras_json import read_cameras_json
from .poses.colmap_model import COLMAP_FILES, find_model, read_colmap_model
from .poses.photographs import Photograph, captures_of
from .poses.polycam import UP, find_keyframes, lidar_depth, read_polycam
from .poses.transforms_json import read_transforms_json
from .sensors.sensor_depth import SensorDepth
from .solving.solving import solve_poses


@dataclass(frozen=True)
class Imported:
    """Captures in the frame of their pose file (the capture frame).

    ``source`` says in words where the poses come from; ``metric`` whether they are known
    to be in metres, ``solved`` whether they were solved here. ``up`` (3,) is the direction up
    where the device measured gravity, and ``depth`` what its depth sensor saw.
    """

    captures: tuple[Capture, ...]
    source: str
    metric: bool
    up: np.ndarray | None = None
    depth: SensorDepth | None = None
    solved: bool = False


def import_captures(
    folder: Path, poses: Path | None, settings: CaptureSettings, progress: Progress = SILENT
) -> Imported:
    """The photographs in ``folder`` as undistorted captures.

    ``poses`` is a ``cameras.json``, a ``transforms.json``, a COLMAP folder or a file in it, or a
    raw export of Polycam (docs/formats.md), or None: then ``folder`` is such an export, or the poses are
    solved from the photographs alone. Photographs are not copied: a capture undistorts and
    scales its file when it is read. Raises CaptureError naming the file, the field and the
    cure.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise CaptureError("there is no such folder", where=folder, cure="Give a folder of photographs.")
    poses = find_keyframes(folder) if poses is None else Path(poses)
    if poses is None:
        photographs, source = solve_poses(folder, settings, progress)
        told = {"source": source, "metric": False, "solved": True}
    elif poses.is_dir() or poses.name in COLMAP_FILES:
        poses = poses if poses.is_dir() else poses.parent
        photographs, told = _read_folder(poses, folder, settings, progress)
    else:
        photographs, told = _read_file(poses, folder, progress)
    if not photographs:
        raise CaptureError("no photograph is listed", where=poses, cure="Check the export of the poses.")
    return Imported(captures_of(photographs, settings.max_side_px), **told)


def _read_folder(
    poses: Path, folder: Path, settings: CaptureSettings, progress: Progress
) -> tuple[list[Photograph], dict[str, Any]]:  # fmt: skip
    """The photographs of a folder with poses, and what else it tells of ``Imported``."""
    model, keyframes = find_model(poses), find_keyframes(poses)
    if model is not None:
        return read_colmap_model(model, folder, progress), {"source": "COLMAP model", "metric": False}
    if keyframes is not None:
        photographs, source = read_polycam(keyframes, settings.max_keyframes, progress)
        told = {"source": source, "metric": True, "up": UP, "depth": lidar_depth(keyframes)}
        return photographs, told
    if (poses / "transforms.json").is_file():
        return _read_file(poses / "transforms.json", folder, progress)
    raise CaptureError(
        "there is no COLMAP model, transforms.json or raw export of Polycam in this folder", where=poses,
        cure="Give the folder that holds cameras.bin and images.bin, or .txt; or keyframes.",
    )  # fmt: skip


def _read_file(
    poses: Path, folder: Path, progress: Progress
) -> tuple[list[Photograph], dict[str, Any]]:  # fmt: skip
    """The photographs of a pose file, and what else it tells of ``Imported``."""
    data = fields.read_json(poses)
    if "frames" in data:
        photographs, metric = read_transforms_json(poses, folder, progress)
        return photographs, {"source": "transforms.json", "metric": metric}
    if "captures" in data:
        photographs, metric = read_cameras_json(poses, folder)
        return photographs, {"source": "cameras.json", "metric": metric}
    raise CaptureError(
        "the file has neither 'captures' nor 'frames'", where=poses,
        cure="Give a cameras.json, a transforms.json or a COLMAP folder.",
    )  # fmt: skip

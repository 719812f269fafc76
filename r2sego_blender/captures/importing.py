"""Importing photographs, with the poses somebody solved or with poses solved here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..config.settings import CaptureSettings
from ..core.errors import CaptureError
from ..core.progress import SILENT, Progress
from .capture import Capture
from .poses.photographs import captures_of
from .poses.plain_folder import plain_photographs
from .poses.pose_format import Posed
from .poses.registry import find_export, find_poses
from .sensors.sensor_depth import SensorDepth
from .solving.solving import solve_poses


@dataclass(frozen=True)
class Imported:
    """Captures in the frame of their pose file (the capture frame).

    ``source`` says in words where the poses come from; ``metric`` whether they are known
    to be in metres, ``solved`` whether they were solved here. ``up`` (3,) is the direction up
    where the device measured gravity, ``depth`` what its depth sensor saw, and ``masks`` how many are named.
    """

    captures: tuple[Capture, ...]
    source: str
    metric: bool
    up: np.ndarray | None = None
    depth: SensorDepth | None = None
    solved: bool = False
    masks: int = 0


def import_captures(
    folder: Path,
    poses: Path | None,
    settings: CaptureSettings,
    progress: Progress = SILENT,
    names: Sequence[str] = (),
    first: int = 0,
) -> Imported:
    """The photographs in ``folder`` as undistorted captures.

    ``poses`` are of any kind in ``poses.formats``, a file or a folder (docs/formats.md), or None: then
    ``folder`` is an export with poses of its own, or they are solved from the photographs alone: from
    those of ``names``, else from ``settings.max_keyframes`` that are chosen where there are more. ``first``, unless
    it is 0, takes so many from the front of the list: in the poses' own order, else in that of the names.
    Photographs are not copied: a capture undistorts and scales its file when it is read. Raises
    CaptureError naming the file, the field and the cure.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise CaptureError("there is no such folder", where=folder, cure="Give a folder of photographs.")
    found = find_export(folder) if poses is None else find_poses(Path(poses))
    if found is not None and names:
        raise CaptureError(
            "all photographs that have poses are taken", where=found[1], cure="Take --frames away, or the poses."
        )
    if found is None:
        names = [path.name for path in plain_photographs(folder, SILENT)][:first] if first else names
        posed = Posed(*solve_poses(folder, settings, progress, names))
    else:
        record, poses = found
        posed = record.read(poses, folder, settings, progress)
        posed = replace(posed, photographs=posed.photographs[:first]) if first else posed
    if not posed.photographs:
        raise CaptureError("no photograph is listed", where=poses, cure="Check the export of the poses.")
    captures = captures_of(posed.photographs, settings.max_side_px)
    return Imported(captures, posed.source, posed.metric, posed.up, posed.depth, found is None, posed.masks)

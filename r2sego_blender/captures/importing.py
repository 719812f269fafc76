"""Importing photographs, with the poses somebody solved or with poses solved here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..config.settings import CaptureSettings
from ..core.errors import CaptureError
from ..core.progress import SILENT, Progress
from .capture import Capture
from .keyframes.choosing import photograph_keyframes
from .poses.photographs import MIN_CAPTURES, captures_of
from .poses.plain_folder import plain_photographs
from .poses.pose_format import Posed
from .poses.registry import find_export, find_poses
from .sensors.sensor_depth import SensorDepth
from .solving.solving import solve_poses

_ALL = 100_000


@dataclass(frozen=True)
class Choice:
    """Which photographs are taken, where not those that are taken without being asked for.

    ``names`` are those of photographs, or numbers of a video's frames. ``first``, unless it is 0, takes so many from
    the front of the list: in the poses' own order, else in that of the names. ``keyframes``, unless it is 0, chooses so
    many of those with poses, of which all are taken else. Raises CaptureError for fewer than three first ones.
    """

    names: tuple[str, ...] = ()
    first: int = 0
    keyframes: int = 0

    def __post_init__(self) -> None:
        if 0 < self.first < MIN_CAPTURES:
            raise CaptureError(
                f"the first {self.first} photographs are asked for, at least {MIN_CAPTURES} are needed",
                where="--first",
                cure=f"Give {MIN_CAPTURES} or more, or 0 for all.",
            )


@dataclass(frozen=True)
class Imported:
    """Captures in the frame of their pose file (the capture frame).

    ``source`` says in words where the poses come from, ``changes`` what was done to them and the lenses since;
    ``metric`` whether they are known to be in metres, ``solved`` whether they were solved here. ``up`` (3,) is the
    direction up where the device measured gravity, ``depth`` what its depth sensor saw, and ``masks`` how many are
    named. ``stated_sizes`` are the (width, height) by captures' names that ``lens_file`` says the lenses are for.
    """

    captures: tuple[Capture, ...]
    source: str
    metric: bool
    up: np.ndarray | None = None
    depth: SensorDepth | None = None
    solved: bool = False
    masks: int = 0
    changes: tuple[str, ...] = ()
    stated_sizes: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    lens_file: Path | None = None

    @property
    def described(self) -> str:
        """Where the poses come from and what was done to them."""
        return "; ".join((self.source, *self.changes))

    def changed(self, captures: Sequence[Capture], *what: str) -> Imported:
        """These ``captures`` in their place, and in words ``what`` is new."""
        return replace(self, captures=tuple(captures), changes=(*self.changes, *what))


def import_captures(
    folder: Path, poses: Path | None, settings: CaptureSettings, progress: Progress = SILENT, choice: Choice = Choice()
) -> Imported:
    """The photographs in ``folder`` as undistorted captures.

    ``poses`` are of any kind in ``poses.formats``, a file or a folder (docs/formats.md), or None: then
    ``folder`` has poses of its own (``find_export``), or they are solved from the photographs alone, of which
    ``settings.max_keyframes`` are chosen where there are more. Photographs are not copied: a capture undistorts and
    scales its file when it is read. Raises CaptureError naming the file, the field and the cure.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise CaptureError("there is no such folder", where=folder, cure="Give a folder of photographs.")
    found = find_export(folder) if poses is None else find_poses(Path(poses))
    names = choice.names
    if found is None:
        names = (
            tuple(path.name for path in plain_photographs(folder, SILENT))[: choice.first] if choice.first else names
        )
        posed = Posed(*solve_poses(folder, settings, progress, names))
    else:
        record, poses = found
        posed = record.read(poses, folder, replace(settings, max_keyframes=_ALL) if names else settings, progress)
        posed = replace(posed, photographs=posed.photographs[: choice.first]) if choice.first else posed
        if names or choice.keyframes:
            posed = _chosen(posed, choice, progress)
    if not posed.photographs:
        raise CaptureError("no photograph is listed", where=poses, cure="Check the export of the poses.")
    captures = captures_of(posed.photographs, settings.max_side_px)
    return Imported(
        captures,
        posed.source,
        posed.metric,
        posed.up,
        posed.depth,
        found is None,
        posed.masks,
        stated_sizes={one.name: (one.lens.width, one.lens.height) for one in posed.photographs},
        lens_file=posed.lens_file or poses,
    )


def _chosen(posed: Posed, choice: Choice, progress: Progress) -> Posed:
    by_path = {one.path: one for one in posed.photographs}
    taken = photograph_keyframes(list(by_path), choice.keyframes, progress, choice.names)
    return replace(posed, photographs=[by_path[path] for path in taken])

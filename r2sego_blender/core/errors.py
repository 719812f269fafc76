"""The one family of errors: each names what is wrong, where, and the cure."""

from __future__ import annotations

from typing import Any

from .printable import printable


class R2SEgoError(Exception):
    """Base of every error this library raises on purpose.

    The message is one line a person can act on: what is wrong, in which file and
    field, and what to do. A command prints it and exits with a non-zero code; an
    operator reports it and returns ``CANCELLED``. Names in it are others': what would control a
    terminal is written out, and what is long is cut.
    """

    def __init__(self, what: str, *, where: object = None, cure: str = "") -> None:
        self.what = what
        self.where = None if where is None else str(where)
        self.cure = cure
        place = f"{self.where}: " if self.where else ""
        super().__init__(" ".join(printable(" ".join(part.split())) for part in (place, f"{what}.", cure) if part))

    def __reduce__(self) -> tuple[Any, ...]:
        """As it is told to another process, which makes the message anew."""
        return _again, (type(self), self.what, self.where, self.cure)


def _again(kind: type[R2SEgoError], what: str, where: str | None, cure: str) -> R2SEgoError:
    return kind(what, where=where, cure=cure)


class CaptureError(R2SEgoError):
    """Photographs, camera files or a COLMAP model that cannot be used."""


class NoOverlapError(CaptureError):
    """Photographs that share too little for anything to be measured of what they show."""


class SceneError(R2SEgoError):
    """A scene bundle that is missing, locked, damaged or of another version."""


class SettingsError(R2SEgoError):
    """An unknown setting, or a value outside its range."""


class GeometryError(R2SEgoError):
    """Geometry that cannot be observed, fused or turned into a collision surface."""


class RobotError(R2SEgoError):
    """A robot model, behaviour scope or rollout that cannot work."""


class NoFloorError(RobotError):
    """A collision surface that leaves the robot no floor to stand on."""


class GenerationError(R2SEgoError):
    """Conditions, generated clips or their registration that cannot be made."""


class AssetError(R2SEgoError):
    """A splat asset or its file that cannot be used."""


class EvaluationError(R2SEgoError):
    """Ground truth that is missing or damaged, or something it cannot score."""


class ExperimentError(R2SEgoError):
    """A plan of experiments, or a cell of one, that cannot be run as it is."""


class TrialError(R2SEgoError):
    """A plan of trials, a device, a calibration or a record that cannot be used."""


class MachineError(R2SEgoError):
    """Something this machine lacks: a package, a system library, disk space."""


class NativeError(R2SEgoError):
    """Native code, run in a process of its own, that ended without a complete result."""


def may_not_be_read(file: object, kind: type[R2SEgoError]) -> R2SEgoError:
    """A file that is there and may not be read, which is no damage: nothing has to be made again."""
    return kind("it may not be read", where=file, cure="Allow reading it, and all that it lies in.")


def of_file(error: OSError) -> SceneError:
    """A file that fails on the way, in a sentence: a disk is full, or what was there is not any more."""
    return SceneError(
        f"it cannot be read or written: {error.strerror or error}",
        where=error.filename2 or error.filename,  # of a rename the place, not what is on its way there
        cure="Check that it is there, that you may write there, and that the disk has room.",
    )

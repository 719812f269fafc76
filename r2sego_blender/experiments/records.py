"""The record of a cell that is done: its scores, what it took, and what made it. Its key is what it was made from."""

from __future__ import annotations

import contextlib
import json
import math
import os
import platform
import subprocess
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from .. import __version__
from ..core.atomic_files import write_whole
from ..core.errors import ExperimentError
from ..core.json_files import finite_number, read_json
from ..core.resources import processor
from ..evaluation.surfaces.figures import DEPTH_KINDS, REGION_KINDS, SEEN_BY, SURFACE_KINDS

RECORD = "record.json"
"""The file in a cell's folder."""

PICTURE_KINDS = ("psnr", "ssim", "lpips_alex")
MEASURED_KINDS = ("psnr_corrected", *REGION_KINDS, *DEPTH_KINDS, *SURFACE_KINDS)
"""Of an arm and of each view: scores of whole pictures, and what was measured where it could be."""

_LARGEST = 1e15  # seconds, MB, dB: sums of them stay finite


@dataclass(frozen=True)
class Stage:
    """One command of a cell: seconds on the clock and of the processors, and the most memory, where that is known."""

    name: str
    seconds: float
    cpu_s: float | None
    peak_mb: float | None


@dataclass(frozen=True)
class Record:
    """What a finished cell leaves.

    ``key`` is the cell's. ``arms`` are the bundle's scores (``report/metrics.json``), ``assets`` the digests of what
    was scored; ``stages`` are the commands of the last run, and ``steps`` the seconds of every step of its bundle,
    whenever it was made. ``made_by`` says version, commit and machine, ``finished`` when, in seconds since 1970.
    ``not_scored`` are the arms that could not be run here, and why; ``equipment`` is what there was to score with.
    """

    key: str
    arms: Mapping[str, Any]
    assets: Mapping[str, str]
    stages: tuple[Stage, ...]
    steps: Mapping[str, float]
    made_by: Mapping[str, str]
    finished: float
    not_scored: Mapping[str, str] = field(default_factory=dict)
    equipment: Mapping[str, str] = field(default_factory=dict)

    @property
    def seconds(self) -> float:
        """On the clock, of all its stages, also those that an earlier run had done."""
        return max(sum(stage.seconds for stage in self.stages), sum(self.steps.values()))

    @property
    def peak_mb(self) -> float | None:
        """The most memory that one of its stages took, where that is known."""
        return max((stage.peak_mb for stage in self.stages if stage.peak_mb is not None), default=None)

    def write(self, folder: Path) -> None:
        """Into a cell's folder, whole or not at all."""
        write_whole(folder / RECORD, json.dumps(asdict(self), indent=1, sort_keys=True) + "\n")


def read_record(folder: Path) -> Record | None:
    """The record in a cell's folder, None where there is none. Raises ExperimentError for a damaged one."""
    file = folder / RECORD
    try:
        data = read_json(file)
        stages = tuple(
            Stage(str(one["name"]), _number(one["seconds"]), *(_known(one[key]) for key in ("cpu_s", "peak_mb")))
            for one in data["stages"]
        )
        return Record(
            str(data["key"]),
            {str(name): _scores(arm) for name, arm in data["arms"].items()},
            {str(name): str(digest) for name, digest in data["assets"].items()},
            stages,
            {str(name): _number(seconds) for name, seconds in data["steps"].items()},
            {str(name): str(value) for name, value in data["made_by"].items()},
            _number(data["finished"]),
            {str(arm): str(why) for arm, why in data.get("not_scored", {}).items()},
            {str(name): str(identity) for name, identity in data.get("equipment", {}).items()},
        )
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise ExperimentError(
            f"this record is damaged: {error}", where=file, cure="Remove it: the cell goes on from its bundle."
        ) from error


def final_record(folder: Path, key: str, equipment: Mapping[str, str]) -> Record | None:
    """The record in a cell's folder, None unless it has the ``key`` and lacks nothing that could be scored here.

    What was scored elsewhere stays where this machine has not the ``equipment``. Raises as ``read_record``.
    """
    record = read_record(folder)
    if record is None or record.key != key:
        return None
    as_here = all(own in ("", record.equipment.get(name, "")) for name, own in equipment.items())
    return record if as_here else None


def _number(value: Any) -> float:
    number = finite_number(value)
    if abs(number) > _LARGEST:
        raise ValueError(f"{value} is too large a number")
    return number


def _known(value: Any) -> float | None:
    return None if value is None else _number(value)


def score_of(scored: Mapping[str, Any], kind: str) -> float | None:
    """A score of an arm or a view; None where it was not measured. A PSNR of null is that of equal images."""
    if kind not in scored:
        return None
    value: float | None = scored[kind]
    return math.inf if value is None and kind.startswith("psnr") else value


def _scores(arm: Any) -> dict[str, Any]:
    """An arm's scores and those of each view; a PSNR of None is that of equal images.

    Of what surfaces tell, only what was measured is there.
    """
    views = [{"name": str(view["name"]), **_kinds(view)} for view in arm["views"]]
    told = {key: str(arm[key]) for key in (SEEN_BY, "backend") if key in arm}
    return {**_kinds(arm), **told, "views": views}


def _kinds(scored: Any) -> dict[str, float | None]:
    found = {kind: _known(scored.get(kind)) for kind in PICTURE_KINDS}
    return found | {kind: _known(scored[kind]) for kind in MEASURED_KINDS if kind in scored}


@cache
def made_by() -> Mapping[str, str]:
    """This version, its commit where it runs in a checkout, and this machine."""
    return {
        "version": __version__,
        "commit": _commit(),
        "processor": processor(),
        "cores": str(os.cpu_count() or ""),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
    }


def _commit() -> str:
    """The commit of this checkout, with a + where files differ; "" where it is none."""
    root = Path(__file__).parents[2]
    if not (root / ".git").exists():
        return ""
    command = ["git", "-C", str(root), "describe", "--always", "--abbrev=12", "--exclude=*", "--dirty=+"]
    with contextlib.suppress(OSError, subprocess.SubprocessError):
        return subprocess.run(command, capture_output=True, text=True, timeout=10.0).stdout.strip()
    return ""

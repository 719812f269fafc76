"""What the engine leaves in a bundle as JSON tables: a round's counts, scores, the robot's facts, cameras."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..core.errors import SceneError
from ..core.json_files import read_json, write_json
from .artifacts import Artifact

_CURE = "Run `r2sego refine` again."


def read_table(file: Path, cure: str = _CURE) -> dict[str, Any]:
    """The JSON object in a file of a bundle. Raises SceneError, with ``cure``, when it holds none."""
    try:
        content = read_json(file)
    except (ValueError, OSError) as error:
        raise damaged(file, str(error), cure) from error
    if not isinstance(content, dict):
        raise damaged(file, "it holds no table", cure)
    return content


def damaged(file: Path, why: str, cure: str = _CURE) -> SceneError:
    """The error of a file that does not hold what it should."""
    return SceneError(f"this file of the scene is damaged: {why}", where=file, cure=cure)


def _write(table: dict[str, Any], file: Path) -> None:
    write_json(file, table)


def _scores(file: Path) -> dict[str, Any]:
    return read_table(file, "Run `r2sego evaluate` again, or remove the file.") if file.is_file() else {}


def _registered(file: Path) -> dict[str, Any]:
    cure = "Make the scene anew with `r2sego new`."
    table = read_table(file, cure)
    if not isinstance(table.get("captures"), list):
        raise damaged(file, "it lists no captures", cure)
    return table


COUNTS = Artifact("metrics.json", read_table, _write, editable=False)
"""How much a round made of everything: ``COUNTS.of_round(l)``."""

METRICS = Artifact("report/metrics.json", _scores)
"""The scores that the last evaluation left; empty before the first."""

BASELINE_METRICS = Artifact("report/baselines.json", _scores)
"""The scores of methods of others that were asked for alone, without a refinement; empty before."""

BASELINES = ("vanilla_3dgs", "gaussgym", "same_points", "difix3d_plus", "genfusion")
"""The arms of ``METRICS`` that are methods of others. A gain is told against the one that scores best."""

ROBOT_FACTS = Artifact("robot/robot.json", read_table, _write)
"""What the engine last said of the declared robot, for those who cannot read robots."""

CAMERAS = Artifact("captures/cameras.json", _registered)
"""The list of the captures with their cameras, as it is written (docs/formats.md)."""

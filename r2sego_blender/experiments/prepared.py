"""Prepared plans of the paper's tables, and the scenes of a folder that they are run on."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..config.declared_files import did_you_mean, shipped_names
from ..core.errors import ExperimentError
from .plan import Plan, PlannedScene

_PLANS = Path(__file__).with_name("plans")
_CAMERAS = "cameras.json"

PREPARED = shipped_names(_PLANS)
"""The names of the prepared plans."""


def prepared_plan(name: str, data: Path, scenes: Sequence[str] = ()) -> Plan:
    """A prepared plan on the scenes in ``data``, or on those of them that are named.

    Raises ExperimentError where there are none, or not those.
    """
    return Plan.load(_PLANS / f"{name}.toml", scenes_in(data, scenes))


def scenes_in(data: Path, names: Sequence[str] = ()) -> tuple[PlannedScene, ...]:
    """The scenes of a folder, by name: what lies in it with a ``cameras.json`` of captures and frozen views.

    The captures' order there is that of nested sets. A folder with such a file of its own is one scene.
    Raises ExperimentError as ``prepared_plan``.
    """
    data = data.absolute()
    inside = sorted(data.iterdir(), key=lambda place: place.name) if data.is_dir() else []
    folders = [data] if (data / _CAMERAS).is_file() else [one for one in inside if (one / _CAMERAS).is_file()]
    found = {one.name: one for one in folders}
    if not found:
        raise ExperimentError(
            f"there is no scene with a {_CAMERAS}",
            where=data,
            cure="Give a folder of scenes, as docs/experiments.md says.",
        )
    for name in names:
        if name not in found:
            cure = did_you_mean(name, found, f"There are: {', '.join(found)}.")
            raise ExperimentError(f"there is no scene '{name}'", where=data, cure=cure)
    chosen = [found[name] for name in names or found]
    return tuple(PlannedScene(one, one / _CAMERAS, poses=one / _CAMERAS) for one in chosen)

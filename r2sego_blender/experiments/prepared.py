"""Prepared plans: the paper's tables on the scenes of a folder, and other people's data sets."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..config.declared_files import did_you_mean
from ..core.errors import ExperimentError
from ..core.progress import SILENT, Progress
from .datasets.registry import dataset
from .plan import Plan, PlannedPreset, PlannedScene
from .staging import CAMERAS, staged

_PLANS = Path(__file__).with_name("plans")
_OF_DATASETS = Path(__file__).parent / "datasets" / "plan.toml"

SCENES = "scenes"
"""The folder in an experiment's that holds a data set's scenes as they are used."""


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
    folders = [data] if (data / CAMERAS).is_file() else [one for one in inside if (one / CAMERAS).is_file()]
    found = {one.name: one for one in folders}
    if not found:
        raise ExperimentError(
            f"there is no scene with a {CAMERAS}",
            where=data,
            cure="Give a folder of scenes, as docs/experiments.md says.",
        )
    chosen = _chosen(found, names, data)
    return tuple(PlannedScene(one, one / CAMERAS, poses=one / CAMERAS) for one in chosen.values())


@dataclass(frozen=True)
class DatasetChoice:
    """What of a data set is asked for; what is 0 or empty is as the set's protocol, or its plan, has it.

    ``scenes`` by name, ``captures`` a scene, ``seeds`` from 0 on, and whether captures have their ``sensor_depth``.
    """

    scenes: Sequence[str] = ()
    captures: int = 0
    preset: str = ""
    seeds: int = 0
    sensor_depth: bool = False


def dataset_plan(
    name: str, data: Path, folder: Path, choice: DatasetChoice = DatasetChoice(), progress: Progress = SILENT
) -> Plan:
    """The plan of a data set whose files are in ``data``, with its scenes as they are used in ``folder``.

    Raises ExperimentError for a set or scene that is not there, CaptureError for what cannot be read.
    """
    known, data = dataset(name), data.absolute()
    found = known.scenes(data)
    if not found:
        raise ExperimentError(
            f"there is no scene of {name}", where=data, cure=f"Give the folder of scenes that hold {known.about}."
        )
    scenes = []
    for scene, place in _chosen(found, choice.scenes, data).items():
        split = known.split(place, scene, choice.captures or known.captures, progress)
        progress.message(f"{scene}: {len(split.captures)} captures, {len(split.frozen)} held-out: {split.protocol}")
        scenes.append(staged(split, scene, folder.absolute() / scene, choice.sensor_depth))
    plan = dataclasses.replace(Plan.load(_OF_DATASETS, scenes), published=name)
    if choice.preset:
        plan = dataclasses.replace(plan, presets=(PlannedPreset(choice.preset, choice.preset),))
    return dataclasses.replace(plan, seeds=tuple(range(choice.seeds))) if choice.seeds else plan


def _chosen(found: Mapping[str, Path], names: Sequence[str], data: Path) -> dict[str, Path]:
    """The scenes of these names, or all. Raises ExperimentError."""
    for name in names:
        if name not in found:
            cure = did_you_mean(name, found, f"There are: {', '.join(found)}.")
            raise ExperimentError(f"there is no scene '{name}'", where=data, cure=cure)
    return {name: found[name] for name in names or found}

"""The cells of a plan: what each is made of, told by a digest, and where it lies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..bundle.artifacts import Artifact
from ..bundle.figures import BASELINE_METRICS, BASELINES, METRICS
from ..bundle.keys import step_key
from ..evaluation.arms import baseline_settings
from .inputs import SceneInputs
from .plan import Plan, PlannedPreset, PlannedScene

CELLS, IMPORTS = "cells", "imports"
"""The folders of an experiment."""

Group = tuple[str, str, int]
"""Preset, scene and capture count: the cells that differ by their seed alone."""


@dataclass(frozen=True, eq=False)
class Cell:
    """One scene with one count of captures, preset and seed, and the arms that are compared in it.

    ``key`` is the digest of all that it is made of: a cell that was finished with it is not run again, unless what it
    could not be scored with is there now (``equipment``).
    ``folder`` holds its bundle, log and record; ``imported`` is the bundle of the captures that cells of one
    scene and count share.
    """

    scene: PlannedScene
    captures: int
    preset: PlannedPreset
    seed: int
    arms: tuple[str, ...]
    threads: int
    folder: Path
    imported: Path
    inputs: SceneInputs
    key: str

    @property
    def name(self) -> str:
        """For people."""
        return f"{self.scene.name}, {self.captures} captures, {self.preset.name}, seed {self.seed}"

    @property
    def group(self) -> Group:
        """What it has in common with those of other seeds."""
        return self.preset.name, self.scene.name, self.captures

    @property
    def bundle(self) -> Path:
        """Its bundle."""
        return self.folder / "bundle.r2s"

    @property
    def refined(self) -> bool:
        """Whether some of its arms takes a refinement: methods of others alone do not."""
        return not set(self.arms) <= set(BASELINES)

    @property
    def metrics(self) -> Artifact[dict[str, Any]]:
        """Where its bundle has the scores."""
        return METRICS if self.refined else BASELINE_METRICS

    @property
    def shared(self) -> Path | None:
        """What one cell makes for others too, while it is not there yet."""
        return None if self.scene.is_bundle or self.imported.exists() else self.imported


def cells_of(plan: Plan, inputs: Mapping[str, SceneInputs], folder: Path) -> tuple[Cell, ...]:
    """The cells of a plan in the order in which they are run: all scenes, counts and presets of a seed, then the next.

    ``inputs`` are those of each scene by its name; ``folder`` is the experiment's.
    """
    cells = []
    for seed in plan.seeds:
        for preset in plan.presets:
            for scene in plan.scenes:
                of_scene = inputs[scene.name]
                for count in plan.counts or (len(of_scene.captures),):
                    place = folder / CELLS / preset.name / scene.name / f"{count}" / f"seed_{seed}"
                    imported = scene.captures if scene.is_bundle else folder / IMPORTS / scene.name / f"{count}.r2s"
                    arms = plan.arms_at(count)
                    key = _key(of_scene, count, preset, seed, arms)
                    cells.append(Cell(scene, count, preset, seed, arms, plan.threads, place, imported, of_scene, key))
    return tuple(cells)


def _key(inputs: SceneInputs, count: int, preset: PlannedPreset, seed: int, arms: Sequence[str]) -> str:
    """The digest of the library's version, the captures, the frozen views, what else decides scores, and settings."""
    settings = preset.settings(seed)
    baselines = {arm: own for arm, own in baseline_settings(settings.training).items() if arm in arms}
    scene = [inputs.options, inputs.captures[:count], inputs.poses, inputs.others]
    made_of = [settings, baselines, sorted(arms), *scene]
    return step_key(["frozen"], made_of, lambda _: inputs.frozen_sha256)

"""The visual assets a bundle holds, from the start to the end. Blender's Python reads it too."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..core.errors import AssetError
from .layout import BACKDROP, INITIAL_ASSET, REFINED_ASSET, of_round
from .scene import Scene

INITIAL, FINAL = "initial", "final"

PASSES = ("colour", "alpha", "depth", "normals")
"""What can be rendered of an asset."""


@dataclass(frozen=True)
class Stage:
    """One asset: ``name`` is initial, a round's number or final; ``target`` is its name in the bundle.

    ``backdrop`` is the file of what stands behind it and is not in it; None where nothing is
    to be added.
    """

    name: str
    target: str
    file: Path
    backdrop: Path | None = None

    @property
    def label(self) -> str:
        """For people: Initial, Round 0, Final."""
        return stage_label(self.name)


def stage_label(name: str) -> str:
    """What people call the stage of a name."""
    return name.capitalize() if name in (INITIAL, FINAL) else f"Round {name}"


def stages(scene: Scene) -> tuple[Stage, ...]:
    """The assets that are there: initial, each round's, final.

    A round's asset is kept without the backdrop, which the final one holds; the initial one is
    shown as it is, as in the evaluation.
    """
    backdrop = scene.path / BACKDROP
    # One that was made and is gone, or no file any more, is told where it is read.
    behind = backdrop if backdrop.exists() or BACKDROP in scene.outputs() else None
    rounds = {str(index): of_round(index, "asset.ply") for index in range(scene.rounds_done())}
    targets = {INITIAL: INITIAL_ASSET, **rounds, FINAL: REFINED_ASSET}
    all_ = (
        Stage(name, target, scene.path / target, behind if name in rounds else None) for name, target in targets.items()
    )
    return tuple(stage for stage in all_ if stage.file.is_file())


def stage_named(scene: Scene, name: str) -> Stage:
    """The stage of a name. Raises AssetError when the bundle has none such."""
    found = stages(scene)
    for stage in found:
        if stage.name == name:
            return stage
    names = ", ".join(stage.name for stage in found) or "none yet; run Refine first"
    raise AssetError(f"there is no asset '{name}'", where=scene.path, cure=f"There are: {names}.")

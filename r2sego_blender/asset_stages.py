"""The visual assets a bundle holds, from the start to the end. Blender's Python reads it too."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from .errors import AssetError
from .scene import Scene

INITIAL, FINAL = "initial", "final"

PASSES = ("colour", "alpha", "depth", "normals")
"""What can be rendered of an asset."""


@dataclass(frozen=True)
class Stage:
    """One asset: ``name`` is initial, a round's number or final.

    ``backdrop`` is the file of what stands behind it and is not in it; None where nothing is
    to be added.
    """

    name: str
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
    backdrop = scene.geometry_folder / "backdrop.ply"
    behind = backdrop if backdrop.is_file() else None
    all_ = [Stage(INITIAL, scene.geometry_folder / "initial_asset.ply")]
    all_ += [
        Stage(str(index), scene.round_folder(index) / "asset.ply", behind)
        for index in range(scene.rounds_done())
    ]
    all_.append(Stage(FINAL, scene.asset_file))
    return tuple(stage for stage in all_ if stage.file.is_file())


def stage_named(scene: Scene, name: str) -> Stage:
    """The stage of a name. Raises AssetError when the bundle has none such."""
    found = stages(scene)
    for stage in found:
        if stage.name == name:
            return stage
    names = ", ".join(stage.name for stage in found) or "none yet; run Refine first"
    raise AssetError(f"there is no asset '{name}'", where=scene.path, cure=f"There are: {names}.")

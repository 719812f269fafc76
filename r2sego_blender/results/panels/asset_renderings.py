"""Where the engine's renderings of the assets stand in a bundle, and which of them are kept. No bpy."""

from __future__ import annotations

import contextlib
import hashlib
import json
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ...bundle.asset_stages import INITIAL, Stage, stage_named
from ...core.errors import R2SEgoError
from .bundle import Bundle

FOLDER = ".pictures"
"""Of the bundle: renderings to look at, which no step reads; it may be deleted at any time."""

SIDES = ("BEFORE", "AFTER")
"""Which of a round's two assets: the one that lacks what its views show, and the one trained on them."""

_AT_WORK_S = 3600.0  # another Blender's engine may be writing into a folder as young as this


def stage_beside(bundle: Bundle, round_index: int, side: str) -> Stage:
    """The asset before or after a round. Raises AssetError when it is not there."""
    index = round_index - (side == "BEFORE")
    return stage_named(bundle.scene, INITIAL if index < 0 else str(index))


def views_folder(bundle: Bundle, round_index: int, stage: Stage) -> Path:
    """Where an asset's renderings from a round's views stand: elsewhere when either has changed."""
    selection = bundle.selection_folder(round_index) / "selection.npz"
    return _folder(bundle, [round_index, stage.name, _written(stage.file), _written(selection)])


def camera_folder(bundle: Bundle, stage: Stage, camera: dict[str, Any]) -> Path:
    """Where an asset's rendering from one camera is made; it goes when Blender has taken it over."""
    return _folder(bundle, [camera, stage.name, _written(stage.file)])


def renderings_of_view(bundle: Bundle, round_index: int, rank: int) -> dict[str, Path]:
    """The renderings from a view that are there, by what they show: "asset before the round"."""
    files = {side: folder / f"{rank:03d}.png" for side, folder in _of_round(bundle, round_index)}
    return {f"asset {side.lower()} the round": file for side, file in files.items() if file.is_file()}


def prune(bundle: Bundle) -> None:
    """Remove the renderings that nothing shows any more: of earlier assets, or of one camera.

    What is left is two folders a round at most, and what was begun within the last hour. What
    cannot be removed stays.
    """
    kept = {folder for index in range(bundle.rounds()) for _, folder in _of_round(bundle, index)}
    for folder in (bundle.path / FOLDER).glob("*/"):
        with contextlib.suppress(OSError):  # another Blender removes them too
            if folder not in kept and time.time() - folder.stat().st_mtime > _AT_WORK_S:
                shutil.rmtree(folder, ignore_errors=True)


def remove_rendering(bundle: Bundle, file: Path) -> None:
    """Remove the folder of one camera's rendering, if it stands where those are made."""
    if file.parent.parent == bundle.path / FOLDER:
        shutil.rmtree(file.parent, ignore_errors=True)


def _of_round(bundle: Bundle, round_index: int) -> Iterator[tuple[str, Path]]:
    """The sides of a round that are there, and their folders."""
    for side in SIDES:
        with contextlib.suppress(R2SEgoError, OSError):  # the round has not come to that yet
            yield side, views_folder(bundle, round_index, stage_beside(bundle, round_index, side))


def _folder(bundle: Bundle, made_of: list[Any]) -> Path:
    return bundle.path / FOLDER / hashlib.sha256(json.dumps(made_of).encode()).hexdigest()[:16]


def _written(file: Path) -> int:
    return file.stat().st_mtime_ns

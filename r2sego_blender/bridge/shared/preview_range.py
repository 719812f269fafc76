"""The timeline's preview range, lent to a clip until something else is looked at."""

from __future__ import annotations

import bpy

_LENT = "r2sego_preview_range"


def lend(scene: bpy.types.Scene, first: int, last: int) -> None:
    """Play the frames ``first`` to ``last`` alone, until ``give_back``."""
    kept = scene.get(_LENT)
    before = list(kept[:3]) if kept is not None else _range(scene)
    scene[_LENT] = [*before, first, last]
    scene.use_preview_range = True
    scene.frame_preview_start, scene.frame_preview_end = first, last


def give_back(scene: bpy.types.Scene) -> None:
    """The range as it was before ``lend``, unless a person has set another one since."""
    kept = scene.get(_LENT)
    if kept is None:
        return
    used, first, last, lent_first, lent_last = kept
    del scene[_LENT]
    if _range(scene) == [1, lent_first, lent_last]:
        scene.use_preview_range = bool(used)
        scene.frame_preview_start, scene.frame_preview_end = first, last


def _range(scene: bpy.types.Scene) -> list[int]:
    return [int(scene.use_preview_range), scene.frame_preview_start, scene.frame_preview_end]

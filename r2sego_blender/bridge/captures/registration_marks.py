"""In which registration an object was placed, so that one from before a correction is noticed."""

from __future__ import annotations

import bpy

from ...results.panels.bundle import Bundle

_REGISTRATION = "r2sego_registration"


def note_registration(one: bpy.types.Object, bundle: Bundle) -> None:
    """Note that the object is placed in the world as it is registered now."""
    one[_REGISTRATION] = _registration(bundle)


def was_corrected_since(one: bpy.types.Object, bundle: Bundle) -> bool:
    """Whether the world was corrected since the object was placed; earlier versions did not note it: no."""
    now = _registration(bundle)
    return list(one.get(_REGISTRATION, now)) != now


def _registration(bundle: Bundle) -> list[float]:
    """(16,): the similarity that took the captures' frame to the world, row by row."""
    return [number for row in bundle.scene.declaration.world_from_capture for number in row]

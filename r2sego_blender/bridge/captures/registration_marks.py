"""In which registration an object was placed, so that one from before a correction is noticed."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from ...results.panels.bundle import Bundle

_REGISTRATION = "r2sego_registration"


def note_registration(one: bpy.types.Object, bundle: Bundle) -> None:
    """Note that the object is placed in the world as it is registered now."""
    one[_REGISTRATION] = registration_of(bundle)


def was_corrected_since(one: bpy.types.Object, now: Sequence[float]) -> bool:
    """Whether the object was placed in another registration than that of ``now``; earlier versions did not
    note it: no."""
    return list(one.get(_REGISTRATION, now)) != list(now)


def registration_of(bundle: Bundle) -> list[float]:
    """(16,): the similarity that took the captures' frame to the world, row by row."""
    return [number for row in bundle.scene.declaration.world_from_capture for number in row]

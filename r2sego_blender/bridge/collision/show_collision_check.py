"""The spheres that do not rest on the collision surface, marked where they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import bpy

from ...results.panels.bundle import Bundle
from ..shared.outliner import clear, find_collection, fresh_collection, link

PART = "Collision check"
_RADIUS_M = 0.05
_MOST = 200  # empties that are still told apart; the worst come first


def show_off_surface(
    scene: bpy.types.Scene, bundle: Bundle, places: Sequence[Mapping[str, Any]]
) -> list[bpy.types.Object]:
    """An empty of a sphere's size for each, in place of those of the last check.

    ``places`` as ``check-collision`` tells them: ``what`` became of its ``spheres``, ``place_m`` (3,)
    in the world, ``gap_m`` or None. Its name says how far they are off.
    """
    if not places:
        forget_off_surface(scene, bundle)
        return []
    collection = fresh_collection(scene, bundle.path, PART)
    marks = []
    for place in places[:_MOST]:
        gap_m = place["gap_m"]
        by = "" if gap_m is None else f" by {100.0 * abs(gap_m):.1f} cm"
        mark = bpy.data.objects.new(f"Sphere {place['what']}{by}", None)
        mark.empty_display_type, mark.empty_display_size = "SPHERE", _RADIUS_M
        mark.location, mark.show_in_front = place["place_m"], True
        link(collection, mark)
        marks.append(mark)
    return marks


def forget_off_surface(scene: bpy.types.Scene, bundle: Bundle) -> None:
    """Remove what the last check marked, if it marked anything."""
    collection = find_collection(scene, bundle.path, PART)
    if collection is not None:
        clear(collection)

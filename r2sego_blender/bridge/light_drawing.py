"""Lighter 3D views, for a Blender that draws without a graphics card."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from .engine_python import addon_preferences

FACES_DRAWN = 30_000
"""Of a proxy: more of them cost software more than the pixels they cover."""

_MODIFIER = "Fewer Faces Drawn"


def lighten_views() -> None:
    """Leave out what costs software most: smooth edges and wires, objects' outlines, and grids.

    Outlines cost by the view's pixels, not by the objects: in Blender 4.3 a fifth of a frame, of
    which those of the selection are the larger part.
    """
    system = bpy.context.preferences.system
    system.viewport_aa = "OFF"
    system.use_overlay_smooth_wire = system.use_edit_mode_smooth_wire = False
    bpy.context.preferences.is_dirty = True  # so that Blender saves them
    for screen in bpy.data.screens:
        for space in (area.spaces.active for area in screen.areas if area.type == "VIEW_3D"):
            overlay = space.overlay
            overlay.show_floor = overlay.show_axis_x = overlay.show_axis_y = False
            overlay.show_ortho_grid = False
            overlay.show_outline_selected = space.shading.show_object_outline = False


def drawn_faces() -> int:
    """How many faces of a proxy the person wants drawn at most, 0 for all."""
    preferences = addon_preferences()
    return preferences.drawn_faces if preferences is not None else 0


def draw_fewer_faces(shown: bpy.types.Object, most: int) -> None:
    """Have the views draw about ``most`` faces of a mesh at most, with 0 all of them.

    Edit Mode and renders have every face; who reads the evaluated mesh does so in ``every_face``.
    """
    modifier = shown.modifiers.get(_MODIFIER)
    if modifier is not None:
        shown.modifiers.remove(modifier)
    count = len(shown.data.polygons)
    if 0 < most < count:
        modifier = shown.modifiers.new(_MODIFIER, "DECIMATE")
        modifier.ratio = most / count
        modifier.show_render = modifier.show_in_editmode = False


@contextmanager
def every_face(shown: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Iterator[None]:
    """Within it the object is evaluated with all faces."""
    modifier = shown.modifiers.get(_MODIFIER)
    if modifier is None:
        yield
        return
    modifier.show_viewport = False
    try:
        depsgraph.update()
        yield
    finally:
        modifier.show_viewport = True

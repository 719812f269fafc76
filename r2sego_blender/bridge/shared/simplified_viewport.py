"""Simplified 3D views, for a Blender that draws without a graphics card."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import bpy
import numpy as np

from ...core.errors import SceneError
from ...results.panels.frusta import VERTICES_PER_FRUSTUM
from .engine_python import addon_preferences

FACES_DRAWN = 6_000
"""Of a proxy, half as many of a robot and of candidates: more cost software more than what they cover."""

_SMALLER_SHARE = 0.5
"""Of a proxy's faces, so many are drawn of a robot and of the candidates' frusta."""

_SIMPLE_FACES = 32  # a shape of so few, a box or a wheel's, would lose its form

_MODIFIER, _GROUP = "Fewer Faces Drawn", "Drawn"


def simplify_views() -> None:
    """Leave out what costs software most: smooth edges and wires, objects' outlines, grids, and what of a
    view lies behind its side bars.

    Outlines cost by the view's pixels, not by the objects: in Blender 4.3 a fifth of a frame, of
    which those of the selection are the larger part. A view that ends at its side bars and headers
    has a third fewer pixels in Blender's first layout with this tab open.
    """
    system = bpy.context.preferences.system
    system.viewport_aa, system.use_region_overlap = "OFF", False
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
    count = len(shown.data.polygons)
    modifier = _modifier_anew(shown, "DECIMATE" if 0 < most < count else "")
    if modifier is not None:
        modifier.ratio = most / count


def draw_fewer_faces_of_robot(bodies: Sequence[bpy.types.Object], most: int) -> None:
    """Have the views draw about half of ``most`` faces of a robot's bodies together, with 0 all of them."""
    counts = [len(body.data.polygons) for body in bodies]
    share = min(1.0, _SMALLER_SHARE * most / max(1, sum(counts))) if most else 1.0
    for body, count in zip(bodies, counts, strict=True):
        draw_fewer_faces(body, max(_SIMPLE_FACES, round(share * count)) if share < 1.0 else 0)


def draw_fewer_frusta(swarm: bpy.types.Object, most: int) -> None:
    """Have the views draw every n-th of a mesh's frusta, about half of ``most`` faces, with 0 all of them."""
    faces, most = len(swarm.data.polygons), math.ceil(_SMALLER_SHARE * most)  # 1 is not all
    group = swarm.vertex_groups.get(_GROUP)
    if group is not None:
        swarm.vertex_groups.remove(group)
    modifier = _modifier_anew(swarm, "MASK" if 0 < most < faces else "")
    if modifier is not None:
        frustum = np.arange(len(swarm.data.vertices)) // VERTICES_PER_FRUSTUM
        drawn = np.flatnonzero(frustum % math.ceil(faces / most) == 0)
        swarm.vertex_groups.new(name=_GROUP).add(drawn.tolist(), 1.0, "REPLACE")
        modifier.vertex_group = _GROUP


def _modifier_anew(shown: bpy.types.Object, kind: str) -> bpy.types.Modifier | None:
    """A modifier of this kind that views alone heed, in place of the one before; none of the kind ''."""
    before = shown.modifiers.get(_MODIFIER)
    if before is not None:
        shown.modifiers.remove(before)
    if not kind:
        return None
    modifier = shown.modifiers.new(_MODIFIER, kind)
    modifier.show_render = modifier.show_in_editmode = False
    return modifier


@contextmanager
def every_face(shown: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Iterator[bpy.types.Object]:
    """Within it the evaluated object, with all faces.

    Raises SceneError for one that Blender does not evaluate: it would lack its modifiers and the place it
    was moved to since.
    """
    if shown.evaluated_get(depsgraph) == shown:
        raise SceneError(
            f"'{shown.name}' is disabled in viewports, or excluded from this view layer",
            cure="Show it and its collection in the Outliner.",
        )
    modifier = shown.modifiers.get(_MODIFIER)
    if modifier is None:
        yield shown.evaluated_get(depsgraph)
        return
    modifier.show_viewport = False
    try:
        depsgraph.update()
        yield shown.evaluated_get(depsgraph)
    finally:
        modifier.show_viewport = True

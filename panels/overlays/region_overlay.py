"""The behaviour region on the floor of every 3D view, and the one that is being drawn."""

import functools

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils.geometry import tessellate_polygon

from .flat_shapes import segments
from .overlay import Overlay

_FLOOR_M = 0.01  # above the floor, which would hide it
_LINE, _FILL = (0.13, 0.62, 0.59, 1.0), (0.13, 0.62, 0.59, 0.22)
_DRAWN_LINE, _DRAWN_FILL = (0.98, 0.75, 0.2, 1.0), (0.98, 0.75, 0.2, 0.15)


@functools.lru_cache(maxsize=4)
def shape_of(text: str) -> tuple[np.ndarray, np.ndarray, tuple]:
    """Corners (n, 3) of a text ``x,y x,y``, its sides as (2 n, 3) points, and its triangles' indices."""
    corners = np.array([[*map(float, pair.split(",")), _FLOOR_M] for pair in text.split()]).reshape(-1, 3)
    sides = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1).reshape(-1, 3)
    triangles = tuple(tessellate_polygon([corners.tolist()])) if len(corners) >= 3 else ()
    return corners, sides, triangles


def drawn_region(context: bpy.types.Context) -> tuple | None:
    """The region to draw in the 3D view of ``context`` as a text, its line's and its fill's colour."""
    robot = getattr(context.scene, "r2sego_robot", None)
    if robot is None:
        return None
    if robot.drawing:
        return robot.drawing, _DRAWN_LINE, _DRAWN_FILL
    if robot.region and robot.show_region and context.space_data.overlay.show_overlays:
        return robot.region, _LINE, _FILL
    return None


def _draw(context: bpy.types.Context) -> None:
    drawn = drawn_region(context)
    if drawn is not None:
        _draw_polygon(*drawn)


def _draw_polygon(text: str, line, fill) -> None:
    corners, sides, triangles = shape_of(text)
    if len(triangles):
        shader = gpu.shader.from_builtin("UNIFORM_COLOR")
        gpu.state.blend_set("ALPHA")
        shader.bind()
        shader.uniform_float("color", fill)
        batch_for_shader(shader, "TRIS", {"pos": corners.astype(np.float32)}, indices=triangles).draw(shader)
        gpu.state.blend_set("NONE")
    segments(sides, line, 2.5 * bpy.context.preferences.system.ui_scale)


REGION = Overlay(_draw, "POST_VIEW")
"""Draws the region of the open bundle's scope."""

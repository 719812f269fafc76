"""What lies under the mouse in a 3D view: the ray from the eye through a pixel.

A view's region knows its own eye: an area in quad view has four of each.
"""

from __future__ import annotations

import bpy
from bpy_extras.view3d_utils import location_3d_to_region_2d, region_2d_to_origin_3d, region_2d_to_vector_3d
from mathutils import Vector


def view_region(area: bpy.types.Area) -> bpy.types.Region:
    """The region of a 3D view's area that shows the scene; in quad view the one that
    ``region_3d`` of its space is of, which turns freely."""
    return [region for region in area.regions if region.type == "WINDOW"][-1]


def is_over(region: bpy.types.Region, event: bpy.types.Event) -> bool:
    """Whether the mouse is over the region."""
    x, y = event.mouse_x - region.x, event.mouse_y - region.y
    return 0 <= x < region.width and 0 <= y < region.height


def mouse_ray(region: bpy.types.Region, event: bpy.types.Event) -> tuple[Vector, Vector]:
    """Origin and direction, in the world, of the ray under the mouse."""
    pixel = (event.mouse_x - region.x, event.mouse_y - region.y)
    return (region_2d_to_origin_3d(region, region.data, pixel), region_2d_to_vector_3d(region, region.data, pixel))


def distance_px(region: bpy.types.Region, event: bpy.types.Event, point: tuple[float, float, float]) -> float:
    """How far the mouse is from a world point on the screen; infinite behind the eye."""
    place = location_3d_to_region_2d(region, region.data, Vector(point))
    if place is None:
        return float("inf")
    return (Vector((event.mouse_x - region.x, event.mouse_y - region.y)) - place).length

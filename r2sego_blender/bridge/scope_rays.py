"""What lies under the mouse in a 3D view: the ray from the eye through a pixel."""

from __future__ import annotations

import bpy
from bpy_extras.view3d_utils import location_3d_to_region_2d, region_2d_to_origin_3d, region_2d_to_vector_3d
from mathutils import Vector


def view_region(area: bpy.types.Area) -> bpy.types.Region:
    """The region of a 3D view's area that shows the scene."""
    return next(region for region in area.regions if region.type == "WINDOW")


def is_over(region: bpy.types.Region, event: bpy.types.Event) -> bool:
    """Whether the mouse is over the region."""
    x, y = event.mouse_x - region.x, event.mouse_y - region.y
    return 0 <= x < region.width and 0 <= y < region.height


def mouse_ray(area: bpy.types.Area, event: bpy.types.Event) -> tuple[Vector, Vector]:
    """Origin and direction, in the world, of the ray under the mouse."""
    region, view = view_region(area), area.spaces.active.region_3d
    pixel = (event.mouse_x - region.x, event.mouse_y - region.y)
    return region_2d_to_origin_3d(region, view, pixel), region_2d_to_vector_3d(region, view, pixel)


def distance_px(area: bpy.types.Area, event: bpy.types.Event, point: tuple[float, float, float]) -> float:
    """How far the mouse is from a world point on the screen; infinite behind the eye."""
    region, view = view_region(area), area.spaces.active.region_3d
    place = location_3d_to_region_2d(region, view, Vector(point))
    if place is None:
        return float("inf")
    return (Vector((event.mouse_x - region.x, event.mouse_y - region.y)) - place).length

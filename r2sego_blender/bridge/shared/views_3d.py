"""The 3D views on the screen."""

from __future__ import annotations

from collections.abc import Iterator

import bpy


def views_3d(scene: bpy.types.Scene | None = None) -> Iterator[bpy.types.Area]:
    """Every 3D view of every window, or of those that show one Blender scene."""
    for window in bpy.context.window_manager.windows:
        if scene is not None and window.scene != scene:
            continue
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                yield area


def look_through(area: bpy.types.Area, camera: bpy.types.Object) -> None:
    """Have a 3D view look through its scene's camera, which this is."""
    view = area.spaces.active
    view.use_local_camera, view.camera = False, camera  # in Local View it would keep its camera of before
    view.region_3d.view_perspective = "CAMERA"


def looks_through_scene_camera(context: bpy.types.Context) -> bool:
    """Whether the context's 3D view looks through its scene's camera: it may have another one of its own, and
    keeps that of before when Local View is left."""
    camera = context.scene.camera
    is_in_camera = context.region_data.view_perspective == "CAMERA"
    return camera is not None and is_in_camera and context.space_data.camera == camera


def redraw_views(region_type: str = "") -> None:
    """Have every 3D view drawn anew, or only its regions of one type, such as ``UI``."""
    for area in views_3d():
        for region in area.regions:
            if region_type in ("", region.type):
                region.tag_redraw()

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


def redraw_views(region_type: str = "") -> None:
    """Have every 3D view drawn anew, or only its regions of one type, such as ``UI``."""
    for area in views_3d():
        for region in area.regions:
            if region_type in ("", region.type):
                region.tag_redraw()

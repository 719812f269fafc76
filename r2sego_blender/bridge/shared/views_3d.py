"""The 3D views on the screen."""

from __future__ import annotations

from collections.abc import Iterator

import bpy


def views_3d() -> Iterator[bpy.types.Area]:
    """Every 3D view of every window; none in background."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                yield area


def redraw_views(region_type: str = "") -> None:
    """Have every 3D view drawn anew, or only its regions of one type, such as ``UI``."""
    for area in views_3d():
        for region in area.regions:
            if region_type in ("", region.type):
                region.tag_redraw()

"""A 3D view that a tool works in from one event to the next, while Blender may close it."""

from __future__ import annotations

import bpy

from .scope_rays import is_over, view_region


class HeldView:
    """The view of an area, and the scene it showed.

    Blender frees areas and regions without telling Python, and whoever reads a freed one crashes:
    what is held is the region's address, looked for among the living. A view that was maximised
    keeps its region in another area.
    """

    def __init__(self, area: bpy.types.Area, scene: bpy.types.Scene) -> None:
        self._region = view_region(area).as_pointer()
        self._scene = scene.session_uid

    def places(self, screen: bpy.types.Screen | None) -> tuple[bpy.types.Area, bpy.types.Region] | None:
        """The area and the region that are the view on a screen now; None when it is not there."""
        for area in screen.areas if screen is not None else ():
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.as_pointer() == self._region and region.type == "WINDOW":
                        return area, region
        return None

    def turn_to_mouse(self, screen: bpy.types.Screen | None, event: bpy.types.Event) -> None:
        """In quad view, the quarter under the mouse is the view from now on."""
        places = self.places(screen)
        for region in places[0].regions if places is not None else ():
            if region.type == "WINDOW" and is_over(region, event):
                self._region = region.as_pointer()

    def lost(self, context: bpy.types.Context) -> str:
        """Why a tool cannot go on in this window, '' when it can."""
        if self.places(context.screen) is None:
            return "its 3D view was closed"
        if context.scene.session_uid != self._scene:
            return "another scene was chosen"
        return ""

"""Draw the behaviour region on the floor."""

import bpy
from bpy.props import BoolProperty, StringProperty

from ...r2sego_blender.bridge.scope_picking import floor_point
from ...r2sego_blender.bridge.scope_rays import distance_px, is_over, mouse_ray, view_region
from ...r2sego_blender.bridge.views_3d import redraw_views
from ...r2sego_blender.robot.region import format_polygon, parse_polygon
from .declaring import DeclaringOperator

_HELP = "Click: corner · Backspace: take one back · Enter or the first corner: done · ESC: cancel"
_CLOSES_PX = 12.0


class R2SEGO_OT_draw_region(DeclaringOperator, bpy.types.Operator):
    """Click the corners of the floor the robot may use, from above; ENTER ends, ESC cancels"""

    bl_idname = "r2sego.draw_region"
    bl_label = "Draw Region"
    bl_options = {"REGISTER"}

    polygon: StringProperty(name="Polygon", description="The corners in metres, in the world: x,y x,y x,y")
    from_above: BoolProperty(
        name="From Above", description="Turn the view to look straight down first", default=True
    )

    def invoke(self, context, event):
        if context.area is None or context.area.type != "VIEW_3D":
            self.report({"ERROR"}, "The region is drawn in a 3D view")
            return {"CANCELLED"}
        if self.from_above:
            with context.temp_override(region=view_region(context.area)):
                bpy.ops.view3d.view_axis(type="TOP")
        self._area, self._corners = context.area, []
        context.workspace.status_text_set(_HELP)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            return self._leave(context, {"CANCELLED"})
        if event.type in {"RET", "NUMPAD_ENTER"} and event.value == "PRESS":
            return self._done(context)
        if event.type in {"BACK_SPACE", "DEL"} and event.value == "PRESS":
            self._corners = self._corners[:-1]
            self._show(context)
            return {"RUNNING_MODAL"}
        if not is_over(view_region(self._area), event):
            return {"PASS_THROUGH"}
        point = floor_point(*mouse_ray(self._area, event))
        if event.type == "MOUSEMOVE":
            self._show(context, point)
        if event.type == "LEFTMOUSE" and event.value == "PRESS":
            closes = len(self._corners) >= 3 and self._is_first(event)
            if closes:
                return self._done(context)
            if point is not None:
                self._corners = [*self._corners, point]
                self._show(context)
            return {"RUNNING_MODAL"}
        return {"PASS_THROUGH"}  # the view can be turned and moved meanwhile

    def cancel(self, context):
        """Blender ends the operator, for example because another file is opened."""
        self._leave(context, {"CANCELLED"})

    def changes(self, context):
        return ["--region", format_polygon(parse_polygon(self.polygon))]

    def _is_first(self, event):
        return distance_px(self._area, event, (*self._corners[0], 0.0)) < _CLOSES_PX

    def _done(self, context):
        self.polygon = format_polygon(self._corners)
        self._leave(context, set())
        return self.execute(context)

    def _show(self, context, under_mouse=None):
        """Let the overlay draw the corners so far, and the one under the mouse."""
        shown = [*self._corners, *([under_mouse] if under_mouse else [])]
        context.scene.r2sego_robot.drawing = format_polygon(shown)
        redraw_views()

    def _leave(self, context, ended):
        context.scene.r2sego_robot.drawing = ""
        context.workspace.status_text_set(None)
        redraw_views()
        return ended

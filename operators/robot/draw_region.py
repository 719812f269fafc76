"""Draw the behaviour region on the floor."""

import bpy
from bpy.props import BoolProperty, StringProperty

from ...r2sego_blender.bridge.robot.scope_picking import floor_point
from ...r2sego_blender.bridge.shared.scope_rays import distance_px, is_over, mouse_ray
from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from ...r2sego_blender.robot.scope.region import format_polygon, parse_polygon
from ..view_tool import ViewTool
from .declaring import DeclaringOperator

_CLOSES_PX = 12.0


class R2SEGO_OT_draw_region(ViewTool, DeclaringOperator, bpy.types.Operator):
    """Click the corners of the floor the robot may use, from above; ENTER ends, ESC cancels"""

    bl_idname = "r2sego.draw_region"
    bl_label = "Draw Region"
    bl_options = {"REGISTER"}

    polygon: StringProperty(name="Polygon", description="The corners in metres, in the world: x,y x,y x,y")
    from_above: BoolProperty(name="From Above", description="Turn the view to look straight down first", default=True)

    hint = "Click: corner · Backspace, Ctrl Z: take one back · Enter or the first corner: done · ESC: cancel"

    def invoke(self, context, event):
        return self.start_tool(context)

    def on_start(self, context):
        if self.from_above:
            bpy.ops.view3d.view_axis(type="TOP")
        self._corners = []

    def on_event(self, context, event):
        if event.type in {"ESC", "RIGHTMOUSE"} and event.value == "PRESS":
            return {"CANCELLED"}
        if event.type in {"RET", "NUMPAD_ENTER"} and event.value == "PRESS":
            return self._done(context)
        back = event.type in {"BACK_SPACE", "DEL"} or (event.type == "Z" and (event.ctrl or event.oskey))
        if back and event.value == "PRESS":  # undo would take back something else
            self._corners = self._corners[:-1]
            self._show(context)
            return {"RUNNING_MODAL"}
        if not is_over(context.region, event):
            return {"PASS_THROUGH"}
        point = floor_point(*mouse_ray(context.region, event))
        if event.type == "MOUSEMOVE":
            self._show(context, point)
        if event.type == "LEFTMOUSE" and event.value == "PRESS":
            closes = len(self._corners) >= 3 and self._is_first(context, event)
            if closes:
                return self._done(context)
            if point is not None:
                self._corners = [*self._corners, point]
                self._show(context)
            return {"RUNNING_MODAL"}
        return {"PASS_THROUGH"}  # the view can be turned and moved meanwhile

    def on_leave(self, context):
        for scene in bpy.data.scenes:  # another one may have been chosen meanwhile
            if scene.r2sego_robot.drawing:
                scene.r2sego_robot.drawing = ""
        redraw_views()

    def changes(self, context):
        return ["--region", format_polygon(parse_polygon(self.polygon))]

    def _is_first(self, context, event):
        closes_px = _CLOSES_PX * context.preferences.system.ui_scale
        return distance_px(context.region, event, (*self._corners[0], 0.0)) < closes_px

    def _done(self, context):
        self.polygon = format_polygon(self._corners)
        return self.execute(context)

    def _show(self, context, under_mouse=None):
        """Let the overlay draw the corners so far, and the one under the mouse."""
        shown = [*self._corners, *([under_mouse] if under_mouse else [])]
        context.scene.r2sego_robot.drawing = format_polygon(shown)
        redraw_views()

"""Drawing a line with the mouse in a 3D view: shared by the lassos, the polygon and the brush."""

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..r2sego_blender.bridge.shared.views_3d import redraw_views
from .view_tool import ViewTool

_STEP_PX = 3.0
_WIDTH_PX = 2.5
_COLOUR = (1.0, 0.35, 0.2, 1.0)


class Drawing(ViewTool):
    """An operator whose ``invoke`` draws in the 3D view, then goes to ``execute``.

    ``begin(context)`` may refuse by raising R2SEgoError; ``end(context, points)`` puts what was
    drawn, region pixels from the lower left, into the operator's properties.
    """

    cursor = "CROSSHAIR"
    clicks = False
    """Whether corners are clicked; else the mouse is dragged."""

    _handle = None
    _shown_in = 0  # the address of the region that shows the line

    def begin(self, context) -> None:
        """Before the first point."""

    def end(self, context, points) -> None:
        """After the last."""

    def invoke(self, context, event):
        return self.start_tool(context)

    def on_start(self, context):
        self._points, self._pressed = [], False
        self.begin(context)
        self._handle = bpy.types.SpaceView3D.draw_handler_add(self._draw, (), "WINDOW", "POST_PIXEL")

    def in_midst(self):
        return bool(self._points)

    def on_event(self, context, event):
        region = context.region
        self._shown_in = region.as_pointer()
        if event.type in {"ESC", "RIGHTMOUSE"} and event.value == "PRESS":
            return {"CANCELLED"}
        at = (event.mouse_x - region.x, event.mouse_y - region.y)
        if event.type in {"MOUSEMOVE", "INBETWEEN_MOUSEMOVE"}:
            region.tag_redraw()
            if self._pressed and not self.clicks:
                self._add(at)
        elif event.type == "LEFTMOUSE" and event.value == "PRESS":
            self._pressed = True
            self._add(at)
        elif self._ended(event):
            self.end(context, self._points)
            return self.execute(context)
        elif event.type in {"MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE"} and not self._points:
            return {"PASS_THROUGH"}
        return {"RUNNING_MODAL"}

    def on_leave(self, context):
        if self._handle is not None:
            bpy.types.SpaceView3D.draw_handler_remove(self._handle, "WINDOW")
            self._handle = None
            redraw_views("WINDOW")

    def _ended(self, event) -> bool:
        if self.clicks:
            closed = event.type in {"RET", "NUMPAD_ENTER"} and event.value == "PRESS"
            return bool(self._points) and (closed or (event.type == "LEFTMOUSE" and event.value == "DOUBLE_CLICK"))
        return event.type == "LEFTMOUSE" and event.value == "RELEASE" and self._pressed

    def _add(self, at) -> None:
        if not self._points or np.hypot(*np.subtract(at, self._points[-1])) >= _STEP_PX:
            self._points.append(at)

    def _draw(self) -> None:
        if bpy.context.region.as_pointer() != self._shown_in or len(self._points) < 2:
            return
        shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
        shader.bind()
        shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
        shader.uniform_float("lineWidth", _WIDTH_PX * bpy.context.preferences.system.ui_scale)
        shader.uniform_float("color", _COLOUR)
        corners = [(*corner, 0.0) for corner in self._points]
        batch_for_shader(shader, "LINE_STRIP", {"pos": [*corners, corners[0]]}).draw(shader)

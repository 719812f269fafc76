"""Mark the splats inside a polygon drawn in a 3D view."""

import bpy
import gpu
import numpy as np
from bpy.props import CollectionProperty, FloatProperty, FloatVectorProperty, IntVectorProperty
from gpu_extras.batch import batch_for_shader

from ...r2sego_blender.bridge.asset_cameras import view_camera
from ...r2sego_blender.errors import AssetError
from ...r2sego_blender.splats.regions import Lasso
from ..base import ReportingOperator
from .marks import add_mark
from .show_asset import needs_splats_at_rest

_STEP_PX = 4.0
_WIDTH_PX = 2.5
_COLOUR = (1.0, 0.35, 0.2, 1.0)


class R2SEGO_OT_mark_splats_lasso(ReportingOperator, bpy.types.Operator):
    """Draw around splats in the 3D view to mark them, between the two depths of the panel"""

    bl_idname = "r2sego.mark_splats_lasso"
    bl_label = "Mark with Lasso"
    bl_options = {"REGISTER", "UNDO"}

    path: CollectionProperty(
        type=bpy.types.OperatorMousePath, name="Path", description="The corners, pixels from the lower left",
        options={"HIDDEN", "SKIP_SAVE"},
    )  # fmt: skip
    view_matrix: FloatVectorProperty(
        name="View Matrix", description="The 3D view's view_matrix, row by row", size=16,
        options={"HIDDEN", "SKIP_SAVE"},
    )  # fmt: skip
    window_matrix: FloatVectorProperty(
        name="Window Matrix", description="The 3D view's window_matrix, row by row", size=16,
        options={"HIDDEN", "SKIP_SAVE"},
    )  # fmt: skip
    region_size: IntVectorProperty(
        name="Region Size", description="Width and height of the 3D view, pixels", size=2,
        options={"HIDDEN", "SKIP_SAVE"},
    )  # fmt: skip
    near: FloatProperty(
        name="Nearest", description="Splats nearer to the view than this are not marked",
        subtype="DISTANCE", unit="LENGTH", min=0.0, default=0.0,
    )  # fmt: skip
    far: FloatProperty(
        name="Farthest", description="Splats farther from the view than this are not marked",
        subtype="DISTANCE", unit="LENGTH", min=0.0, default=100.0,
    )  # fmt: skip

    _handle = None

    @classmethod
    def poll(cls, context):
        return needs_splats_at_rest(cls, context)

    def perform(self, context):
        polygon = np.array([corner.loc for corner in self.path], np.float64).reshape(-1, 2)
        width, height = self.region_size
        if len(polygon) < 3 or width < 1 or height < 1:
            raise AssetError("there is no polygon", cure="Draw around splats in a 3D view.")
        polygon[:, 1] = height - polygon[:, 1]
        view, window = (np.reshape(m, (4, 4)) for m in (self.view_matrix, self.window_matrix))
        if abs(np.linalg.det(view)) < 1e-12 or not window.any():
            raise AssetError("the view's matrices are missing", cure="Give view_matrix and window_matrix.")
        camera, parallel = view_camera(view, window, width, height)
        # A parallel view has no eye to measure from: its plane lies in the middle of what it shows.
        near = -self.far if parallel else self.near
        return add_mark(context.scene, Lasso(camera, polygon, near, self.far, parallel))

    def invoke(self, context, event):
        if context.area is None or context.area.type != "VIEW_3D" or context.region is None:
            self.report({"ERROR"}, "Draw the lasso in a 3D view")
            return {"CANCELLED"}
        group = context.scene.r2sego_asset
        self.near, self.far = group.near, group.far
        self.path.clear()
        # The button stands in the side bar; the lasso is drawn in the view beside it.
        self._region = next(r for r in context.area.regions if r.type == "WINDOW")
        self._view = context.space_data.region_3d
        self._drawing = False
        self._area = context.area
        self._handle = bpy.types.SpaceView3D.draw_handler_add(self._draw, (), "WINDOW", "POST_PIXEL")
        context.workspace.status_text_set("Lasso: drag around splats, release to mark (ESC cancels)")
        context.window.cursor_modal_set("CROSSHAIR")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type in {"ESC", "RIGHTMOUSE"}:
            self._leave(context)
            return {"CANCELLED"}
        if event.type == "LEFTMOUSE" and event.value == "PRESS":
            self._drawing = True
            self._add(event)
        elif event.type == "MOUSEMOVE" and self._drawing:
            self._add(event)
            self._area.tag_redraw()
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE" and self._drawing:
            self.view_matrix = [value for row in self._view.view_matrix for value in row]
            self.window_matrix = [value for row in self._view.window_matrix for value in row]
            self.region_size = self._region.width, self._region.height
            self._leave(context)
            return self.execute(context)
        return {"RUNNING_MODAL"}

    def cancel(self, context):
        """Blender ends the operator, for example because another file is opened."""
        self._leave(context)

    def _add(self, event) -> None:
        at = (event.mouse_x - self._region.x, event.mouse_y - self._region.y)
        if self.path and np.hypot(*np.subtract(at, self.path[-1].loc)) < _STEP_PX:
            return
        self.path.add().loc = at

    def _draw(self) -> None:
        if bpy.context.region != self._region or len(self.path) < 2:
            return
        shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
        shader.bind()
        shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
        shader.uniform_float("lineWidth", _WIDTH_PX)
        shader.uniform_float("color", _COLOUR)
        corners = [(*corner.loc, 0.0) for corner in self.path]
        batch_for_shader(shader, "LINE_STRIP", {"pos": [*corners, corners[0]]}).draw(shader)

    def _leave(self, context) -> None:
        if self._handle is not None:
            bpy.types.SpaceView3D.draw_handler_remove(self._handle, "WINDOW")
            self._handle = None
        if context.window is not None:
            context.window.cursor_modal_restore()
            context.workspace.status_text_set(None)
        self._area.tag_redraw()

"""Select the proxy's faces inside a polygon drawn in a 3D view."""

import bpy
import numpy as np
from bpy.props import BoolProperty, CollectionProperty, FloatProperty, FloatVectorProperty, IntVectorProperty

from ...r2sego_blender.bridge.asset_cameras import view_camera
from ...r2sego_blender.bridge.proxy_edits import face_corners, faces_in_lasso, select_faces
from ...r2sego_blender.errors import GeometryError
from ..base import ReportingOperator, needs_round
from .drawing import Drawing
from .polls import in_object_mode, proxy_shown, show_selection


class R2SEGO_OT_select_proxy_lasso(Drawing, ReportingOperator, bpy.types.Operator):
    """Draw around faces of the shown proxy to select them, as far as they face the view"""

    bl_idname = "r2sego.select_proxy_lasso"
    bl_label = "Select with Lasso"
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
    farthest: FloatProperty(
        name="Farthest", description="Faces farther from the view than this are not selected",
        subtype="DISTANCE", unit="LENGTH", min=0.0, default=20.0,
    )  # fmt: skip
    facing: BoolProperty(name="Facing Only", default=True, description="Only faces whose free side is seen")
    extend: BoolProperty(name="Extend", description="Keep what is selected already")

    hint = "Lasso: drag around faces of the proxy, release to select (ESC cancels)"

    @classmethod
    def poll(cls, context):
        return needs_round(cls, context)

    def perform(self, context):
        shown = proxy_shown(context)
        polygon = np.array([corner.loc for corner in self.path], np.float64).reshape(-1, 2)
        width, height = self.region_size
        view, window = (np.reshape(m, (4, 4)) for m in (self.view_matrix, self.window_matrix))
        if len(polygon) < 3 or width < 1 or height < 1 or abs(np.linalg.det(view)) < 1e-12:
            raise GeometryError("there is no polygon", cure="Draw around faces in a 3D view.")
        polygon[:, 1] = height - polygon[:, 1]
        in_object_mode(context, shown)
        camera, parallel = view_camera(view, window, width, height)
        faces = faces_in_lasso(
            face_corners(shown.data), camera, polygon, parallel=parallel, farthest_m=self.farthest,
            facing=self.facing,
        )  # fmt: skip
        count = select_faces(shown, faces, extend=self.extend)
        show_selection(context, shown)
        return f"{count} faces selected"

    def begin(self, context):
        self.path.clear()
        self.farthest = context.scene.r2sego_proxy.farthest

    def end(self, context, points):
        for point in points:
            self.path.add().loc = point
        view = self._space.region_3d
        self.view_matrix = [value for row in view.view_matrix for value in row]
        self.window_matrix = [value for row in view.window_matrix for value in row]
        self.region_size = self._region.width, self._region.height

"""Select the proxy's faces inside a polygon drawn in a 3D view."""

import bpy
from bpy.props import BoolProperty, FloatProperty

from ...r2sego_blender.bridge.proxy.proxy_edits import faces_in_lasso, select_faces, world_corners
from ...r2sego_blender.core.formatting import counted
from ..base import ReportingOperator
from ..lasso import Lasso
from .polls import in_object_mode, needs_proxy, proxy_shown, show_selection


class R2SEGO_OT_select_proxy_lasso(Lasso, ReportingOperator, bpy.types.Operator):
    """Draw around faces of the shown proxy to select them, as far as they face the view"""

    bl_idname = "r2sego.select_proxy_lasso"
    bl_label = "Select with Lasso"
    bl_options = {"REGISTER", "UNDO"}

    farthest: FloatProperty(
        name="Farthest",
        description="Faces farther from the view than this are not selected",
        subtype="DISTANCE",
        unit="LENGTH",
        min=0.0,
        default=20.0,
    )
    facing: BoolProperty(name="Facing Only", default=True, description="Only faces whose free side is seen")
    extend: BoolProperty(name="Extend", description="Keep what is selected already")

    hint = "Lasso: drag around faces of the proxy, release to select (ESC cancels)"

    @classmethod
    def poll(cls, context):
        return needs_proxy(cls, context)

    def perform(self, context):
        shown = proxy_shown(context)
        camera, polygon, parallel = self.drawn()
        in_object_mode(context, shown)
        context.view_layer.update()
        faces = faces_in_lasso(
            world_corners(shown),
            camera,
            polygon,
            parallel=parallel,
            farthest_m=self.farthest,
            facing=self.facing,
            kept_sides=self.kept_sides(),
        )
        count = select_faces(shown, faces, extend=self.extend)
        show_selection(context, shown)
        return f"{counted(count, 'face')} selected"

    def begin(self, context):
        super().begin(context)
        proxy_shown(context)  # who draws first and is refused then has drawn in vain
        self.farthest = context.scene.r2sego_proxy.farthest

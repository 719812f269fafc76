"""Mark the splats inside a polygon drawn in a 3D view."""

import bpy
from bpy.props import FloatProperty

from ...r2sego_blender.splats.regions import Lasso as LassoRegion
from ..base import ReportingOperator
from ..lasso import Lasso
from .marks import add_mark
from .polls import needs_splats_at_rest


class R2SEGO_OT_mark_splats_lasso(Lasso, ReportingOperator, bpy.types.Operator):
    """Draw around splats in the 3D view to mark them, between the two depths of the panel"""

    bl_idname = "r2sego.mark_splats_lasso"
    bl_label = "Mark with Lasso"
    bl_options = {"REGISTER", "UNDO"}

    near: FloatProperty(
        name="Nearest",
        description="Splats nearer to the view than this are not marked",
        subtype="DISTANCE",
        unit="LENGTH",
        min=0.0,
        default=0.0,
    )
    far: FloatProperty(
        name="Farthest",
        description="Splats farther from the view than this are not marked",
        subtype="DISTANCE",
        unit="LENGTH",
        min=0.0,
        default=100.0,
    )

    hint = "Lasso: drag around splats, release to mark (ESC cancels)"

    @classmethod
    def poll(cls, context):
        return needs_splats_at_rest(cls, context)

    def perform(self, context):
        camera, polygon, parallel = self.drawn()
        # A parallel view has no eye to measure from: its plane lies in the middle of what it shows.
        near = -self.far if parallel else self.near
        region = LassoRegion(camera, polygon, near, self.far, parallel, self.kept_sides())
        return add_mark(context.scene, region)

    def begin(self, context):
        super().begin(context)
        group = context.scene.r2sego_asset
        self.near, self.far = group.near, group.far

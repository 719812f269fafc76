"""Mark the splats in a box; a box to do it with."""

import bpy
import numpy as np
from bpy.props import FloatVectorProperty

from ...r2sego_blender.bridge.asset.placed_box import placed_box
from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from ...r2sego_blender.core.errors import AssetError
from ...r2sego_blender.splats.regions import Box
from ..base import ReportingOperator, select_only
from .marks import add_mark
from .polls import needs_splats_at_rest


class R2SEGO_OT_mark_splats_box(ReportingOperator, bpy.types.Operator):
    """Mark the splats whose centres lie in the active object's box, or between two corners"""

    bl_idname = "r2sego.mark_splats_box"
    bl_label = "Mark in Box"
    bl_options = {"REGISTER", "UNDO"}

    lowest: FloatVectorProperty(
        name="Lowest Corner",
        description="In the world; equal corners mean the active object's box",
        subtype="XYZ_LENGTH",
        unit="LENGTH",
        size=3,
        options={"SKIP_SAVE"},
    )
    highest: FloatVectorProperty(
        name="Highest Corner",
        description="In the world; equal corners mean the active object's box",
        subtype="XYZ_LENGTH",
        unit="LENGTH",
        size=3,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context):
        return needs_splats_at_rest(cls, context)

    def perform(self, context):
        lowest, highest = np.array(self.lowest), np.array(self.highest)
        if not (lowest == highest).all():
            pose = np.eye(4)
            pose[:3, 3] = (lowest + highest) / 2.0
            return add_mark(context.scene, Box(pose, np.abs(highest - lowest) / 2.0))
        active = context.view_layer.objects.active
        if active is None or active == context.scene.r2sego_asset.shown:
            raise AssetError("no box is chosen", cure="Select a box or an empty, or give two corners.")
        context.view_layer.update()
        return add_mark(context.scene, placed_box(active))


class R2SEGO_OT_add_splat_box(ReportingOperator, bpy.types.Operator):
    """Add an empty box at the 3D cursor, to move and scale around splats that are to be deleted"""

    bl_idname = "r2sego.add_splat_box"
    bl_label = "Add Box"
    bl_options = {"REGISTER", "UNDO"}

    half_extents: FloatVectorProperty(
        name="Half Size",
        description="From the box's middle to its sides",
        subtype="XYZ_LENGTH",
        unit="LENGTH",
        size=3,
        min=0.001,
        default=(0.3, 0.3, 0.3),
    )

    @classmethod
    def poll(cls, context):
        return needs_splats_at_rest(cls, context)

    def perform(self, context):
        box = bpy.data.objects.new("Splat box", None)
        box.empty_display_type, box.empty_display_size = "CUBE", 1.0
        box.location, box.scale = context.scene.cursor.location, self.half_extents
        context.scene.collection.objects.link(box)
        select_only(context, box)
        redraw_views()
        return ""

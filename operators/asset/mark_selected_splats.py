"""Mark the splats that are selected as vertices."""

import bpy
import numpy as np
from bpy.props import FloatProperty

from ...r2sego_blender.core.errors import AssetError
from ...r2sego_blender.splats.regions import Cells
from ..base import ReportingOperator
from .marks import add_mark, world_centres
from .polls import needs_shown_asset


class R2SEGO_OT_mark_selected_splats(ReportingOperator, bpy.types.Operator):
    """Mark the splats selected in Edit Mode, as small cells of space that outlive a new refinement"""

    bl_idname = "r2sego.mark_selected_splats"
    bl_label = "Mark Selected"
    bl_options = {"REGISTER", "UNDO"}

    cell: FloatProperty(
        name="Cell",
        description="Side of the cells; splats in the same cell go together",
        subtype="DISTANCE",
        unit="LENGTH",
        min=0.001,
        max=1.0,
        default=0.01,
    )

    @classmethod
    def poll(cls, context):
        return needs_shown_asset(cls, context)

    def perform(self, context):
        shown = context.scene.r2sego_asset.shown
        editing = shown.mode == "EDIT"
        if editing:
            shown.update_from_editmode()
        selected = np.empty(len(shown.data.vertices), bool)
        shown.data.vertices.foreach_get("select", selected)
        if not selected.any():
            raise AssetError("no splat is selected", where=shown.name, cure="Select vertices in Edit Mode.")
        cells = Cells.around(world_centres(shown)[selected], self.cell)
        if editing:  # attributes of a mesh that is edited cannot be written
            bpy.ops.object.mode_set(mode="OBJECT")
        return add_mark(context.scene, cells)

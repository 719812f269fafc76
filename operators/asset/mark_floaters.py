"""Mark splats that stand alone, are faint or are too large."""

import bpy
from bpy.props import FloatProperty, IntProperty

from ...r2sego_blender.bridge.asset.show_asset import drawn_splats
from ...r2sego_blender.core.errors import AssetError
from ...r2sego_blender.splats.floaters import neighbours
from ...r2sego_blender.splats.regions import Cells
from ..base import ReportingOperator
from .marks import add_mark, world_centres
from .polls import needs_splats_at_rest

_CELL_M = 0.005
"""Side of the cells that stand for the splats: small, so that few others go with them."""


class R2SEGO_OT_mark_floaters(ReportingOperator, bpy.types.Operator):
    """Mark splats with few others around them, and, if wanted, faint and large ones; never the backdrop"""

    bl_idname = "r2sego.mark_floaters"
    bl_label = "Mark Floaters"
    bl_options = {"REGISTER", "UNDO"}

    distance: FloatProperty(
        name="Distance",
        description="How far around a splat others are counted",
        subtype="DISTANCE",
        unit="LENGTH",
        min=0.001,
        default=0.1,
    )
    fewest: IntProperty(
        name="Fewest",
        description="A splat with fewer than these around it is marked; 0 marks none for it",
        min=0,
        default=5,
    )
    faint: FloatProperty(
        name="Fainter Than",
        description="Splats less opaque than this are marked; 0 marks none for it",
        subtype="FACTOR",
        min=0.0,
        max=1.0,
        default=0.0,
    )
    large: FloatProperty(
        name="Larger Than",
        description="Splats of a larger radius are marked; 0 marks none for it",
        subtype="DISTANCE",
        unit="LENGTH",
        min=0.0,
        default=0.0,
    )

    @classmethod
    def poll(cls, context):
        return needs_splats_at_rest(cls, context)

    def perform(self, context):
        shown = context.scene.r2sego_asset.shown
        splats = None if shown.mode == "EDIT" else drawn_splats(shown.data)
        if splats is None:
            raise AssetError("the splats cannot be read", where=shown.name, cure="Leave Edit Mode, or show them anew.")
        centres, near = world_centres(shown), ~splats.backdrop
        floating = near & (splats.opacities < self.faint)
        if self.large:
            floating |= near & (splats.radii_m > self.large)
        if self.fewest and near.any():
            floating[near] |= neighbours(centres[near], self.distance) < self.fewest
        if not floating.any():
            raise AssetError("no splat is a floater by these limits", cure="Raise Fewest, or lower Distance.")
        return add_mark(context.scene, Cells.around(centres[floating], _CELL_M))

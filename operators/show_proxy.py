"""Show a round's geometry proxy."""

import bpy

from ..r2sego_blender.bridge.show_proxy import show_proxy
from . import state
from .base import ReportingOperator, needs_round


class R2SEGO_OT_show_proxy(ReportingOperator, bpy.types.Operator):
    """Show the geometry proxy: grey was observed, teal is a prior, amber was completed"""

    bl_idname = "r2sego.show_proxy"
    bl_label = "Show Geometry Proxy"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return needs_round(cls, context)

    def perform(self, context):
        shown = show_proxy(context.scene, state.opened_bundle(context), context.scene.r2sego.round_index)
        return f"{shown.name}: {len(shown.data.polygons)} faces"

"""Read the open bundle again."""

import bpy

from .. import state
from ..base import ReportingOperator, names_bundle


class R2SEGO_OT_refresh_scene(ReportingOperator, bpy.types.Operator):
    """Read again what the open bundle holds"""

    bl_idname = "r2sego.refresh_scene"
    bl_label = "Refresh"
    bl_options = {"REGISTER", "UNDO"}  # what changed since is shown anew

    @classmethod
    def poll(cls, context):
        return names_bundle(cls, context)

    def perform(self, context):
        state.refresh(context.scene)
        return ""

"""Ask which learned backends this machine can use."""

import bpy

from ...r2sego_blender.bridge.shared.engine_python import examine_backends
from ..base import ReportingOperator


class R2SEGO_OT_check_backends(ReportingOperator, bpy.types.Operator):
    """Start the Python of each learned model that is set up, and say which can be used and why others cannot"""

    bl_idname = "r2sego.check_backends"
    bl_label = "Check Models"
    bl_options = {"REGISTER"}

    def perform(self, context):
        shown = context.window_manager.r2sego_engine.backends
        shown.clear()
        for label, why, licence in examine_backends():
            one = shown.add()
            one.name, one.why, one.licence = label, why, licence
        return f"{sum(not one.why for one in shown)} of {len(shown)} models can be used"

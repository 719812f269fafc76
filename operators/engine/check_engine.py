"""Ask the engine what it is."""

import bpy

from ...r2sego_blender.bridge.shared.engine_python import examine
from ..base import ReportingOperator


class R2SEGO_OT_check_engine(ReportingOperator, bpy.types.Operator):
    """Start the engine's Python and say which packages it has and lacks"""

    bl_idname = "r2sego.check_engine"
    bl_label = "Check Engine"
    bl_options = {"REGISTER"}

    def perform(self, context):
        line = context.window_manager.r2sego_engine.found = examine()
        return line

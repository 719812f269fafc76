"""Take the line of an ended job away."""

import bpy
from bpy.props import IntProperty

from ...r2sego_blender.core.errors import SceneError
from ..base import ReportingOperator


class R2SEGO_OT_dismiss_job(ReportingOperator, bpy.types.Operator):
    """Take away the line with which a job of the engine ended"""

    bl_idname = "r2sego.dismiss_job"
    bl_label = "Dismiss"
    bl_options = {"REGISTER"}

    index: IntProperty(name="Line", description="Which line, from 0", min=0)

    @classmethod
    def poll(cls, context):
        if not context.window_manager.r2sego_engine.ended:
            cls.poll_message_set("No job has ended since: there is nothing to dismiss")
            return False
        return True

    def perform(self, context):
        ended = context.window_manager.r2sego_engine.ended
        if self.index >= len(ended):
            raise SceneError(f"there is no line {self.index}", cure=f"There are {len(ended)}.")
        ended.remove(self.index)
        return ""

"""Cancel the running command of the engine."""

import bpy

from .. import job


class R2SEGO_OT_cancel(bpy.types.Operator):
    """Cancel what the engine is doing; finished steps are kept"""

    bl_idname = "r2sego.cancel"
    bl_label = "Cancel"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context):
        if not job.is_running():
            cls.poll_message_set("The engine is idle")
            return False
        return True

    def execute(self, context):
        context.window_manager.r2sego_job.cancel_requested = True
        return {"FINISHED"}

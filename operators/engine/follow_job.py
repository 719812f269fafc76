"""Follow a job that a former Blender started."""

import bpy

from ...r2sego_blender.bridge.shared.reports import reported
from ...r2sego_blender.core.errors import SceneError
from ..base import ReportingOperator, needs_idle_engine, waits_for_engine
from .following import look_again, take_over, unfollowed_jobs


class R2SEGO_OT_follow_job(ReportingOperator, bpy.types.Operator):
    """Look for a job of the engine that another Blender started and left, and follow it to its end"""

    bl_idname = "r2sego.follow_job"
    bl_label = "Follow Job"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context):
        return needs_idle_engine(cls)

    def perform(self, context):
        found = unfollowed_jobs(context)
        if not found:
            raise SceneError("no job was left behind", cure="Open the scene it works on, then look again.")
        if not waits_for_engine(context):
            look_again()  # the timer follows it
            return f"Following: {found[0].title}"
        title = found[0].title
        try:
            take_over(found[0])
        except RuntimeError as error:
            raise SceneError(reported(error).rstrip("."), where=title) from error
        return context.window_manager.r2sego_engine.ended[-1].line

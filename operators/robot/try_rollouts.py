"""Try the behaviour without a round."""

import bpy
from bpy.props import IntProperty

from .. import state
from ..base import EngineOperator, needs_bundle, needs_idle_engine


class R2SEGO_OT_try_rollouts(EngineOperator, bpy.types.Operator):
    """Simulate a few attempts on the newest collision surface; no round changes. ESC cancels"""

    bl_idname = "r2sego.try_rollouts"
    bl_label = "Try Rollouts"
    bl_options = {"REGISTER"}

    attempts: IntProperty(name="Attempts", description="How many attempts are made", default=6, min=1, max=1000)

    @classmethod
    def poll(cls, context):
        if not (needs_bundle(cls, context) and needs_idle_engine(cls)):
            return False
        if context.scene.r2sego.rounds_begun == 0:
            cls.poll_message_set("There is no collision surface yet: run Refine first")
            return False
        return True

    def arguments(self, context):
        bundle = state.opened_bundle(context)
        return ["try-rollouts", str(bundle.path), "--attempts", str(self.attempts), "--json-progress"]

    def finish(self, context, result):
        context.scene.r2sego_robot.source = "TRIAL"
        state.refresh(context.scene)
        return f"{result.get('succeeded', 0)} of {result.get('attempts', self.attempts)} attempts succeeded"

"""End a study."""

import bpy
from bpy.props import StringProperty

from ...r2sego_blender.core.errors import TrialError
from ..base import EngineOperator, needs_idle_engine
from . import facts
from .polls import needs_study


class R2SEGO_OT_end_study(EngineOperator, bpy.types.Operator):
    """End the study for good, for a reason that stays with it: no trial of it is run again"""

    bl_idname = "r2sego.end_study"
    bl_label = "End Study"
    bl_options = {"REGISTER"}

    reason: StringProperty(name="Reason", description="Why it ends", options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        if not needs_study(cls, context):
            return False
        if facts.of(context.scene).state.ended:
            cls.poll_message_set("The study was ended: its folder says when and why")
            return False
        return needs_idle_engine(cls)

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self, width=400)

    def draw(self, context):
        self.layout.prop(self, "reason")

    def arguments(self, context):
        if not self.reason.strip():
            raise TrialError("an end has its reason", cure="Give one.")
        return ["trials", "end", facts.study_path(context.scene), "--reason", self.reason, "--json-progress"]

    def finish(self, context, result):
        facts.read(facts.study_path(context.scene))
        return "The study was ended"

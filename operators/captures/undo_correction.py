"""Take the last correction of the registration back."""

import bpy

from .. import state
from ..base import EngineOperator, needs_bundle, needs_idle_engine
from .correct_registration import show_corrected


class R2SEGO_OT_undo_correction(EngineOperator, bpy.types.Operator):
    """Take the last correction of ground, scale or frame back"""

    bl_idname = "r2sego.undo_correction"
    bl_label = "Undo Correction"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context):
        if not (needs_bundle(cls, context) and needs_idle_engine(cls)):
            return False
        if not context.scene.r2sego_captures.corrections:
            cls.poll_message_set("There is no correction to take back: nothing was corrected yet")
            return False
        return True

    def arguments(self, context):
        return ["register", str(state.opened_bundle(context).path), "--json-progress", "--undo"]

    def finish(self, context, result):
        show_corrected(context, {})
        return f"Taken back: {result.get('ground', '')}; {result.get('scale', '')}"

"""Score the scene on frozen views."""

import bpy
from bpy.props import StringProperty

from ...r2sego_blender.core.errors import CaptureError
from .. import state
from ..base import EngineOperator, needs_bundle, needs_idle_engine


class R2SEGO_OT_evaluate(EngineOperator, bpy.types.Operator):
    """Score the scene on photographs that were held out, against plain Gaussian splatting"""

    bl_idname = "r2sego.evaluate"
    bl_label = "Evaluate"
    bl_options = {"REGISTER"}

    filepath: StringProperty(
        name="Frozen Views",
        subtype="FILE_PATH",
        description="cameras.json with a 'frozen' list, or a folder of held-out photographs",
    )
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        if not (needs_bundle(cls, context) and needs_idle_engine(cls)):
            return False
        if context.scene.r2sego.rounds_done == 0:
            cls.poll_message_set("There is no refined asset to score yet: run Refine first")
            return False
        return True

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def arguments(self, context):
        if not self.filepath:
            raise CaptureError("no held-out photographs are chosen", cure="Choose their cameras.json.")
        bundle = str(state.opened_bundle(context).path)
        return ["evaluate", bundle, "--frozen", bpy.path.abspath(self.filepath), "--json-progress"]

    def finish(self, context, result):
        state.refresh(context.scene)
        return "Evaluated: see the report"

"""Plan a study of trials."""

from pathlib import Path

import bpy
from bpy.props import StringProperty

from ...r2sego_blender.core.errors import TrialError
from ..base import EngineOperator, needs_idle_engine, needs_own_scene
from .open_study import open_study


class R2SEGO_OT_plan_trials(EngineOperator, bpy.types.Operator):
    """Draw the plan of a declared study and freeze it: order, poses and rules, fixed before the first trial"""

    bl_idname = "r2sego.plan_trials"
    bl_label = "New Plan"
    bl_options = {"REGISTER"}

    filepath: StringProperty(
        name="Declaration", description="What you declare of the study, a TOML file", subtype="FILE_PATH"
    )
    filter_glob: StringProperty(default="*.toml", options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        return needs_own_scene(cls, context) and needs_idle_engine(cls)

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def arguments(self, context):
        if not self.filepath:
            raise TrialError("no declaration is chosen", cure="Choose a TOML file, as docs/trials.md describes it.")
        return ["trials", "plan", bpy.path.abspath(self.filepath), "--json-progress"]

    def finish(self, context, result):
        return open_study(context.scene, Path(result.get("study", "")))

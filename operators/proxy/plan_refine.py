"""Ask the engine what the next Refine would run again."""

import bpy

from ...r2sego_blender.bridge.settings_properties import overrides
from .. import state
from ..base import EngineOperator, needs_bundle, needs_idle_engine


class R2SEGO_OT_plan_refine(EngineOperator, bpy.types.Operator):
    """Say which steps the next Refine would run again, with the settings as they are now"""

    bl_idname = "r2sego.plan_refine"
    bl_label = "What Refine Redoes"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context):
        return needs_bundle(cls, context) and needs_idle_engine(cls)

    def arguments(self, context):
        scene, bundle = context.scene.r2sego, state.opened_bundle(context)
        command = ["plan", str(bundle.path), "--json-progress", "--preset", scene.preset]
        declared = bundle.scene.declaration.overrides
        for key, value in overrides(scene.settings, scene.preset, declared).items():
            command += ["--set", f"{key}={value:.6g}" if isinstance(value, float) else f"{key}={value}"]
        return command

    def finish(self, context, result):
        line = str(result.get("line", ""))
        context.scene.r2sego_proxy.plan = line
        return line or "The engine said nothing of it"

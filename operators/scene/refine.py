"""Run the refinement."""

import bpy

from ...r2sego_blender.bridge.scene.settings_properties import overrides
from ...r2sego_blender.results.panels.scene_choices import what_refine_does
from .. import state
from ..base import EngineOperator, needs_bundle, needs_idle_engine


class R2SEGO_OT_refine(EngineOperator, bpy.types.Operator):
    """Run the refinement of the open scene; started again, it goes on where it stopped. ESC cancels"""

    bl_idname = "r2sego.refine"
    bl_label = "Refine"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context):
        return needs_bundle(cls, context) and needs_idle_engine(cls)

    @classmethod
    def description(cls, context, properties):
        scene = context.scene.r2sego
        rounds = scene.rounds_begun, scene.rounds_done, scene.rounds_declared
        what = what_refine_does(*rounds) if scene.bundle else ""
        return f"{cls.__doc__}. {what}".rstrip(". ")

    def arguments(self, context):
        scene, bundle = context.scene.r2sego, state.opened_bundle(context)
        command = ["refine", str(bundle.path), "--json-progress", "--preset", scene.preset]
        declared = bundle.scene.declaration.overrides
        for key, value in overrides(scene.settings, scene.preset, declared).items():
            command += ["--set", f"{key}={value}"]
        return command

    def finish(self, context, result):
        scene = context.scene.r2sego
        scene.round_index = max(0, state.opened_bundle(context).rounds() - 1)  # reads the bundle again
        return f"Refined: {scene.rounds_done} of {scene.rounds_declared} rounds"

"""Ask the engine what the next Refine would run again."""

from dataclasses import replace

import bpy

from ...r2sego_blender.bridge.shared.panel_facts import facts_of, keep
from ..base import EngineOperator, needs_bundle, needs_idle_engine
from ..scene.refine import R2SEGO_OT_refine
from .facts import ProxyFacts


class R2SEGO_OT_plan_refine(EngineOperator, bpy.types.Operator):
    """Say which steps the next Refine would run again, with the settings as they are now"""

    bl_idname = "r2sego.plan_refine"
    bl_label = "What Refine Redoes"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context):
        return needs_bundle(cls, context) and needs_idle_engine(cls)

    def arguments(self, context):
        return ["plan", *R2SEGO_OT_refine.arguments(self, context)[1:]]  # as Refine would be started

    def finish(self, context, result):
        line = str(result.get("line", ""))
        scene = context.scene
        keep(scene, replace(facts_of(scene, ProxyFacts), plan=line))
        return line or "The engine said nothing of it"

"""Have the engine count what the robot sees of the proxy."""

import bpy

from ...r2sego_blender.bridge.proxy.show_proxy import show_proxy, shown_proxy, shown_round
from .. import state
from ..base import EngineOperator, needs_idle_engine, needs_round
from .facts import ProxyFacts
from .properties import colour_shown


class R2SEGO_OT_measure_coverage(EngineOperator, bpy.types.Operator):
    """Count how many of the robot's candidate views see each face of this round's proxy"""

    bl_idname = "r2sego.measure_coverage"
    bl_label = "Measure Coverage"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context):
        return needs_round(cls, context) and needs_idle_engine(cls)

    def arguments(self, context):
        index = context.scene.r2sego.round_index
        return ["coverage", str(state.opened_bundle(context).path), "--round", str(index), "--json-progress"]

    def finish(self, context, result):
        state.refresh(context.scene)
        bundle, index = state.opened_bundle(context), context.scene.r2sego.round_index
        shown = shown_proxy(context.scene, bundle.path)
        if shown is not None and shown.mode != "EDIT" and shown_round(shown) == index:
            show_proxy(context.scene, bundle, index)
            state.read_again(context.scene, ProxyFacts)
            colour_shown(context.scene)
        areas = result.get("areas_m2")
        if not areas:
            return "Measured the coverage"
        seen, gap = areas["seen"], areas["gap"]
        return f"The robot sees {seen:.1f} m\u00b2; no capture supports {gap:.1f} m\u00b2 of them"

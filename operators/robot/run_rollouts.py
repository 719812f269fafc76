"""Run a round's rollouts."""

import bpy
from bpy.props import IntProperty

from .. import state
from ..base import EngineOperator, needs_bundle, needs_idle_engine
from .facts import round_of


class R2SEGO_OT_run_rollouts(EngineOperator, bpy.types.Operator):
    """Roll out the declared behaviour for the round, after the steps it stands on. ESC cancels"""

    bl_idname = "r2sego.run_rollouts"
    bl_label = "Run Rollouts"
    bl_options = {"REGISTER"}

    round_index: IntProperty(
        name="Round", description="The round, from 0; -1 is the one that is shown", default=-1, min=-1
    )

    @classmethod
    def poll(cls, context):
        return needs_bundle(cls, context) and needs_idle_engine(cls)

    def arguments(self, context):
        index = round_of(context.scene, False, self.round_index)
        bundle = state.opened_bundle(context)
        return ["rollouts", str(bundle.path), "--round", str(index), "--json-progress"]

    def finish(self, context, result):
        context.scene.r2sego_robot.source = "ROUND"
        state.refresh(context.scene)
        return f"{result.get('succeeded', 0)} rollouts succeeded in {result.get('attempts', 0)} attempts"

"""Evaluate a policy in the scene."""

import bpy
from bpy.props import IntProperty, StringProperty

from ...r2sego_blender.results.panels.rollout_list import POLICY, rollouts_folder
from ...r2sego_blender.results.policy_evaluation import MOST_EPISODES
from .. import state
from ..base import EngineOperator, needs_bundle, needs_idle_engine


class R2SEGO_OT_evaluate_policy(EngineOperator, bpy.types.Operator):
    """Let a policy sit down in the refined scene many times, and keep its episodes to be shown. ESC cancels"""

    bl_idname = "r2sego.evaluate_policy"
    bl_label = "Evaluate Policy"
    bl_options = {"REGISTER"}

    policy: StringProperty(
        name="Policy",
        description="The folder of a training; empty for the teacher, which knows the true state",
        subtype="DIR_PATH",
    )
    episodes: IntProperty(
        name="Episodes", description="How many episodes are tried", default=20, min=1, max=MOST_EPISODES
    )
    seed: IntProperty(name="Seed", description="What the episodes are drawn by", default=0, min=0)

    @classmethod
    def poll(cls, context):
        if not (needs_bundle(cls, context) and needs_idle_engine(cls)):
            return False
        if not context.scene.r2sego.has_collision:
            cls.poll_message_set("There is no refined scene yet: run Refine first")
            return False
        return True

    def arguments(self, context):
        bundle = state.opened_bundle(context)
        policy = bpy.path.abspath(self.policy) if self.policy else "teacher"
        return [
            "policy",
            "evaluate",
            str(bundle.path),
            "--policy",
            policy,
            "--episodes",
            str(self.episodes),
            "--seed",
            str(self.seed),
            "--record",
            str(rollouts_folder(bundle, POLICY)),
            "--json-progress",
        ]

    def finish(self, context, result):
        state.refresh(context.scene)
        return f"{result.get('successes', 0)} of {result.get('episodes', self.episodes)} episodes succeeded"

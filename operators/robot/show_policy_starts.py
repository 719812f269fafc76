"""Show where a policy's episodes began."""

import bpy

from ...r2sego_blender.bridge.robot.show_starts import show_starts
from ...r2sego_blender.results.panels.rollout_list import POLICY, attempts, start_poses
from .. import state
from ..base import ReportingOperator, hint_if_hidden
from .polls import needs_evaluation


class R2SEGO_OT_show_policy_starts(ReportingOperator, bpy.types.Operator):
    """Show on the floor where each episode of the policy began, in the colour of how it ended"""

    bl_idname = "r2sego.show_policy_starts"
    bl_label = "Show Starts"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return needs_evaluation(cls, context)

    def perform(self, context):
        bundle = state.opened_bundle(context)
        ended = [one.reason for one in attempts(bundle, POLICY)]
        shown = show_starts(context.scene, bundle, start_poses(bundle, POLICY), ended)
        return f"{len(ended)} start poses{hint_if_hidden(context, shown)}"

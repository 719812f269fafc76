"""Show a round's candidate views and targets."""

import bpy
from bpy.props import BoolProperty, FloatProperty

from ...r2sego_blender.bridge.show_candidates import show_candidates
from .. import state
from ..base import ReportingOperator, needs_round


class R2SEGO_OT_show_candidates(ReportingOperator, bpy.types.Operator):
    """Show the robot's candidate views, dark to yellow by score, and the target views as cameras"""

    bl_idname = "r2sego.show_candidates"
    bl_label = "Show Candidate Views"
    bl_options = {"REGISTER", "UNDO"}

    frustum_size: FloatProperty(
        name="Frustum Size", description="Depth of a candidate's frustum", default=0.08, min=0.005, max=5.0,
        subtype="DISTANCE", unit="LENGTH",
    )  # fmt: skip
    survivors_only: BoolProperty(
        name="Survivors Only", description="Leave out views that temporal suppression removed"
    )

    @classmethod
    def poll(cls, context):
        return needs_round(cls, context)

    def perform(self, context):
        swarm, targets = show_candidates(
            context.scene, state.opened_bundle(context), context.scene.r2sego.round_index,
            frustum_m=self.frustum_size, survivors_only=self.survivors_only,
        )  # fmt: skip
        return f"{swarm.name}: {len(targets)} target views"

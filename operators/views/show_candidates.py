"""Show a round's candidate views and targets."""

import bpy
from bpy.props import EnumProperty, FloatProperty

from .. import state
from ..base import ReportingOperator, hint_if_hidden, needs_round
from . import display
from .properties import COLOURS, SHOWN


class R2SEGO_OT_show_candidates(ReportingOperator, bpy.types.Operator):
    """Show the robot's candidate views, dark blue to yellow by a score, and the target views as cameras"""

    bl_idname = "r2sego.show_candidates"
    bl_label = "Show Candidate Views"
    bl_options = {"REGISTER", "UNDO"}

    colour_by: EnumProperty(name="Colour", description="What the frusta's colours mean", items=COLOURS)
    shown: EnumProperty(name="Shown", description="Which candidate views are shown", items=SHOWN)
    frustum_size: FloatProperty(
        name="Frustum Size",
        description="Depth of a candidate's frustum",
        default=0.08,
        min=0.005,
        max=5.0,
        subtype="DISTANCE",
        unit="LENGTH",
    )

    @classmethod
    def poll(cls, context):
        return needs_round(cls, context)

    def perform(self, context):
        bundle, group = state.opened_bundle(context), context.scene.r2sego_views
        views = bundle.candidates(context.scene.r2sego.round_index)  # refuses before anything is changed
        group.colour_by, group.shown, group.frustum_size = self.colour_by, self.shown, self.frustum_size
        swarm, targets = display.show(context.scene, bundle)
        told = f"Candidates, round {context.scene.r2sego.round_index}: {len(targets)} target views"
        photographs = len(views.selection.photographs)
        told += f", {photographs} photographs to take" if photographs else ""
        return told + hint_if_hidden(context, swarm)

"""Show the collision surface."""

import bpy
from bpy.props import BoolProperty

from ...r2sego_blender.bridge.collision.show_collision import show_collision
from .. import state
from ..base import ReportingOperator, hint_if_hidden
from .polls import needs_collision
from .properties import CollisionFacts


class R2SEGO_OT_show_collision(ReportingOperator, bpy.types.Operator):
    """Show the surface the robot collides with"""

    bl_idname = "r2sego.show_collision"
    bl_label = "Show Collision"
    bl_options = {"REGISTER", "UNDO"}

    pieces: BoolProperty(name="Convex Pieces", description="The convex pieces as the simulator sees them", default=True)

    @classmethod
    def poll(cls, context):
        return needs_collision(cls, context)

    def perform(self, context):
        shown = show_collision(context.scene, state.opened_bundle(context), pieces=self.pieces)
        state.read_again(context.scene, CollisionFacts)
        return f"{shown.name}: {len(shown.data.polygons)} faces{hint_if_hidden(context, shown)}"

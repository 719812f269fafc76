"""Arrows that say where the world shall be."""

import bpy

from ...r2sego_blender.bridge.captures.registration_frame import place_frame
from ...r2sego_blender.core.errors import SceneError
from .. import state
from ..base import ReportingOperator, needs_bundle, select_only, told


class R2SEGO_OT_place_frame(ReportingOperator, bpy.types.Operator):
    """Place arrows that say where the world shall be"""

    bl_idname = "r2sego.place_frame"
    bl_label = "Place Frame"
    bl_description = (
        "Place arrows with a grid at the world's origin; move, turn and scale them to where it shall be, "
        "then correct by the frame"
    )
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return needs_bundle(cls, context)

    def perform(self, context):
        frame = place_frame(context.scene, state.opened_bundle(context))
        try:
            select_only(context, frame)
        except SceneError as hidden:  # it is placed all the same
            return told(hidden)
        return "Move and turn the arrows onto the floor, then Correct by Frame"

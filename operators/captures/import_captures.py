"""Bring the captures into Blender."""

import bpy
from bpy.props import BoolProperty, FloatProperty

from ...r2sego_blender.bridge.captures.show_captures import show_captures
from ...r2sego_blender.core.formatting import counted
from .. import state
from ..base import ReportingOperator, hint_if_hidden, needs_bundle


class R2SEGO_OT_import_captures(ReportingOperator, bpy.types.Operator):
    """Show each capture as a camera that looks through its photograph"""

    bl_idname = "r2sego.import_captures"
    bl_label = "Import Captures"
    bl_options = {"REGISTER", "UNDO"}

    photographs: BoolProperty(name="Photographs", description="Photographs as the cameras' backgrounds", default=True)
    alpha: FloatProperty(
        name="Opacity", description="Opacity of the photographs", default=0.6, min=0.0, max=1.0, subtype="FACTOR"
    )
    points: BoolProperty(
        name="Points as Object",
        default=False,
        description="The triangulated points as an object that renders too; the overlay draws them anyway",
    )
    point_radius: FloatProperty(
        name="Point Radius",
        description="Radius of a point of that object",
        default=0.006,
        min=0.0005,
        max=0.5,
        subtype="DISTANCE",
        unit="LENGTH",
    )

    @classmethod
    def poll(cls, context):
        return needs_bundle(cls, context)

    def invoke(self, context, event):
        shown = context.scene.r2sego_captures
        self.photographs, self.alpha = shown.show_photographs, shown.photograph_opacity
        return self.execute(context)

    def perform(self, context):
        cameras = show_captures(
            context.scene,
            state.opened_bundle(context),
            photographs=self.photographs,
            points=self.points,
            point_radius_m=self.point_radius,
            photograph_alpha=self.alpha,
        )
        shown = context.scene.r2sego_captures
        shown.show_photographs, shown.photograph_opacity = self.photographs, self.alpha
        hint = hint_if_hidden(context, cameras[0]) if cameras else ""
        return f"Imported {counted(len(cameras), 'capture')}{hint}"

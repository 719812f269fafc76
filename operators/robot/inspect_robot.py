"""Ask the engine about the robot."""

import bpy
from bpy.props import BoolProperty

from .declaring import DeclaringOperator


class R2SEGO_OT_inspect_robot(DeclaringOperator, bpy.types.Operator):
    """Read the declared robot: its joints, its height and its camera; and list the seats it could use"""

    bl_idname = "r2sego.inspect_robot"
    bl_label = "Inspect Robot"
    bl_options = {"REGISTER"}

    seats: BoolProperty(name="Seats", description="List the seats on the newest collision surface too", default=False)

    def changes(self, context):
        return ["--seats"] if self.seats else []

    def finish(self, context, result):
        said = super().finish(context, result)
        if not self.seats:
            return said
        return result.get("no_seats") or f"{len(result.get('seats', ()))} surfaces to sit on"

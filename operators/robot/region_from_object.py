"""Take the behaviour region from an object, or take it away."""

import bpy

from ...r2sego_blender.bridge.robot.scope_outline import outline_of
from ...r2sego_blender.robot.scope.region import format_polygon
from .declaring import DeclaringOperator


class R2SEGO_OT_region_from_object(DeclaringOperator, bpy.types.Operator):
    """Declare the outline of the active mesh or curve, seen from above, as the behaviour region"""

    bl_idname = "r2sego.region_from_object"
    bl_label = "Region from Object"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context):
        if not super().poll(context):
            return False
        if context.object is None or context.object.type not in {"MESH", "CURVE"}:
            cls.poll_message_set("Select a mesh or a curve first: its outline becomes the region")
            return False
        return True

    def changes(self, context):
        polygon = outline_of(context.object, context.evaluated_depsgraph_get())
        return ["--region", format_polygon(polygon)]


class R2SEGO_OT_clear_region(DeclaringOperator, bpy.types.Operator):
    """Let the robot use all of the free floor that the captures saw"""

    bl_idname = "r2sego.clear_region"
    bl_label = "Whole Free Floor"
    bl_options = {"REGISTER"}

    def changes(self, context):
        return ["--region", "free_floor"]

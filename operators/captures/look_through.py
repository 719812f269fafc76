"""Look through a capture or a target view."""

import bpy

from ...r2sego_blender.bridge.cameras import has_lens, use_frame_of
from ..base import ReportingOperator


class R2SEGO_OT_look_through(ReportingOperator, bpy.types.Operator):
    """Look through the active camera, with the image size and pixel aspect of its lens"""

    bl_idname = "r2sego.look_through"
    bl_label = "Look Through"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if not has_lens(context.view_layer.objects.active):
            cls.poll_message_set("Select the camera of a capture or target view first")
            return False
        return True

    def perform(self, context):
        use_frame_of(context.view_layer.objects.active, context.scene)
        if context.area is not None and context.area.type == "VIEW_3D":
            context.space_data.region_3d.view_perspective = "CAMERA"
        return ""

"""Look through a capture or a target view."""

import bpy

from ...r2sego_blender.bridge.cameras import has_lens, use_frame_of
from ...r2sego_blender.bridge.preview_range import give_back
from ...r2sego_blender.bridge.views_3d import views_3d
from ..base import ReportingOperator


def look_through(context, camera):
    """Make ``camera`` the scene's, and have this 3D view, else the first one, look through it."""
    use_frame_of(camera, context.scene)
    give_back(context.scene)
    here = context.area if context.area is not None and context.area.type == "VIEW_3D" else None
    area = here or next(views_3d(), None)
    if area is not None:
        area.spaces.active.region_3d.view_perspective = "CAMERA"


class R2SEGO_OT_look_through(ReportingOperator, bpy.types.Operator):
    """Look through the active camera, with the image size and pixel aspect of its lens"""

    bl_idname = "r2sego.look_through"
    bl_label = "Look Through"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if not has_lens(context.view_layer.objects.active):
            cls.poll_message_set("Select a camera first: one of a capture or of a target view")
            return False
        return True

    def perform(self, context):
        look_through(context, context.view_layer.objects.active)
        return ""

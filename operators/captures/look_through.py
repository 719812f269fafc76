"""Look through a capture or a target view."""

import bpy

from ...r2sego_blender.bridge.captures.show_captures import capture_camera
from ...r2sego_blender.bridge.shared import views_3d
from ...r2sego_blender.bridge.shared.cameras import has_lens, use_frame_of
from ...r2sego_blender.bridge.shared.preview_range import give_back
from .. import state
from ..base import ReportingOperator


def look_through(context, camera):
    """Make ``camera`` the scene's, and have this 3D view, else the first one, look through it."""
    use_frame_of(camera, context.scene)
    give_back(context.scene)
    here = context.area if context.area is not None and context.area.type == "VIEW_3D" else None
    area = here or next(views_3d.views_3d(), None)
    if area is not None:
        views_3d.look_through(area, camera)


def _chosen_camera(context):
    """The active object if it is a camera of ours, else the camera of the list's capture; None: neither."""
    active = context.view_layer.objects.active
    if has_lens(active):
        return active
    shown = context.scene.r2sego_captures
    if shown.active_capture >= len(shown.captures):
        return None
    name = shown.captures[shown.active_capture].name
    return capture_camera(context.scene, state.bundle_path(context.scene), name)


class R2SEGO_OT_look_through(ReportingOperator, bpy.types.Operator):
    """Look through the active camera, else the list's capture, with the image size of its lens"""

    bl_idname = "r2sego.look_through"
    bl_label = "Look Through"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if _chosen_camera(context) is None:
            cls.poll_message_set("Press Import first, or select the camera of a target view")
            return False
        return True

    def perform(self, context):
        look_through(context, _chosen_camera(context))
        return ""

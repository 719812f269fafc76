"""Show the camera's way of a generated clip."""

import bpy

from ...r2sego_blender.bridge.generation.show_path import show_path
from ...r2sego_blender.bridge.shared.cameras import use_frame_of
from ..base import ReportingOperator
from .views import OfOneView


class R2SEGO_OT_show_camera_path(OfOneView, ReportingOperator, bpy.types.Operator):
    """Show the way from the reference capture to the view as a curve, and a camera that goes along it"""

    bl_idname = "r2sego.show_camera_path"
    bl_label = "Show Camera Path"
    bl_options = {"REGISTER", "UNDO"}

    def perform(self, context):
        bundle, shown, record = self.chosen(context)
        path = bundle.camera_path(shown, record.rank)
        _, camera = show_path(context.scene, bundle.path, f"View {record.rank:03d}", path)
        use_frame_of(camera, context.scene)
        context.scene.frame_set(1)
        return f"View {record.rank}: {len(path)} frames, {record.note or 'a straight way'}"

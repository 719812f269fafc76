"""Look through the next or the previous capture."""

import bpy
from bpy.props import BoolProperty

from ...r2sego_blender.bridge.captures.show_captures import capture_camera, capture_cameras
from ...r2sego_blender.core.errors import SceneError
from .. import state
from ..base import ReportingOperator, needs_bundle
from .look_through import look_through


def step_capture(context, step):
    """Choose the capture ``step`` lines further, around the ends, and look through it; its name.

    Raises SceneError when its camera was not imported.
    """
    shown = context.scene.r2sego_captures
    count = len(shown.captures)
    index = (shown.active_capture + step) % max(1, count)
    name = shown.captures[index].name if count else ""
    camera = capture_camera(context.scene, state.bundle_path(context.scene), name)
    if camera is None:
        raise SceneError(f"no camera of the capture '{name}' is shown", cure="Press Import first.")
    shown.active_capture = index
    look_through(context, camera)
    return name


class R2SEGO_OT_look_through_next(ReportingOperator, bpy.types.Operator):
    """Look through the next capture of the list"""

    bl_idname = "r2sego.look_through_next"
    bl_label = "Look Through Next"
    bl_options = {"REGISTER", "UNDO"}

    backwards: BoolProperty(name="Backwards", description="Take the previous capture instead")

    @classmethod
    def poll(cls, context):
        if not needs_bundle(cls, context):
            return False
        if not capture_cameras(context.scene, state.bundle_path(context.scene)):
            cls.poll_message_set("Press Import first")
            return False
        return True

    @classmethod
    def description(cls, context, properties):
        return f"Look through the {'previous' if properties.backwards else 'next'} capture of the list"

    def perform(self, context):
        return f"Looking through {step_capture(context, -1 if self.backwards else 1)}"

"""Open a scene bundle."""

import bpy
from bpy.props import StringProperty

from ...r2sego_blender.bridge.bundle import Bundle
from ...r2sego_blender.errors import SceneError
from .. import state
from ..base import ReportingOperator


class R2SEGO_OT_open_scene(ReportingOperator, bpy.types.Operator):
    """Open a scene bundle and read what it holds"""

    bl_idname = "r2sego.open_scene"
    bl_label = "Open Scene"
    bl_options = {"REGISTER", "UNDO"}

    directory: StringProperty(
        name="Bundle", description="The bundle, a folder that ends in .r2s", subtype="DIR_PATH"
    )
    filter_folder: bpy.props.BoolProperty(default=True, options={"HIDDEN"})

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def perform(self, context):
        if not self.directory:
            raise SceneError("no bundle is chosen", cure="Choose a folder that ends in .r2s.")
        bundle = Bundle.open(bpy.path.abspath(self.directory))
        state.show_bundle(context.scene, bundle)
        return f"Opened {bundle.name}"

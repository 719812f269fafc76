"""Render a target view's structural conditions with Cycles."""

from pathlib import Path

import bpy
from bpy.props import IntProperty, StringProperty

from ...r2sego_blender.bridge.conditions import render_conditions
from ...r2sego_blender.errors import SceneError
from .. import state
from ..base import ReportingOperator, needs_round


class R2SEGO_OT_render_conditions(ReportingOperator, bpy.types.Operator):
    """Render depth, normals, provenance and objects of the proxy along a target view's path (EXR)"""

    bl_idname = "r2sego.render_conditions"
    bl_label = "Render Conditions"
    bl_options = {"REGISTER"}

    view: IntProperty(name="View", description="The target view, from 0", min=0)
    directory: StringProperty(
        name="Folder", description="The folder to write, made if it is missing", subtype="DIR_PATH"
    )
    filter_folder: bpy.props.BoolProperty(default=True, options={"HIDDEN"})
    scale: IntProperty(
        name="Scale", description="Size of the images in percent of the lens", default=100, min=5, max=100,
        subtype="PERCENTAGE",
    )  # fmt: skip

    @classmethod
    def poll(cls, context):
        return needs_round(cls, context)

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def perform(self, context):
        if not self.directory:
            raise SceneError("no folder is chosen", cure="Choose where to write the images.")
        bundle, shown = state.opened_bundle(context), context.scene.r2sego.round_index
        path = [camera.scaled(self.scale / 100.0) for camera in bundle.camera_path(shown, self.view)]
        folder = Path(bpy.path.abspath(self.directory))
        render_conditions(bundle.proxy(shown), path, folder)
        return f"Rendered {len(path)} frames to {folder}"

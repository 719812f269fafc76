"""Render a target view's structural conditions with Cycles."""

import json
import sys

import bpy
from bpy.props import IntProperty, StringProperty

from ...r2sego_blender.core.errors import SceneError
from .. import job, state
from ..base import EngineOperator, needs_idle_engine, needs_round
from ..engine_files import hand_over


class R2SEGO_OT_render_conditions(EngineOperator, bpy.types.Operator):
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
        name="Scale",
        description="Size of the images in percent of the lens",
        default=100,
        min=5,
        max=100,
        subtype="PERCENTAGE",
    )

    @classmethod
    def poll(cls, context):
        return needs_round(cls, context) and needs_idle_engine(cls)

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def start(self, context):
        # Blender's own Python: the engine has no part in it.
        return job.start(self, self.arguments(context), sys.executable, "workers.condition_frames")

    def arguments(self, context):
        if not self.directory:
            raise SceneError("no folder is chosen", cure="Choose where to write the images.")
        bundle, shown = state.opened_bundle(context), context.scene.r2sego.round_index
        path = [camera.scaled(self.scale / 100.0) for camera in bundle.camera_path(shown, self.view)]
        cameras = hand_over("cameras.json", json.dumps([camera.to_json() for camera in path]))
        proxy = bundle.proxy_file(shown).relative_to(bundle.path)
        command = [str(bundle.path), str(proxy), str(cameras), "--to", bpy.path.abspath(self.directory)]
        return [*command, "--blender", bpy.app.binary_path] if bpy.app.binary_path else command

    def finish(self, context, result):
        return f"Rendered {result['frames']} frames to {self.directory}"

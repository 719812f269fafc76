"""The folder of meshes in which shapes of objects are looked for: chosen, and withdrawn."""

import bpy
from bpy.props import BoolProperty, StringProperty

from ...r2sego_blender.core.errors import GeometryError
from .. import state
from ..base import EngineOperator, needs_bundle, needs_idle_engine


class R2SEGO_OT_choose_mesh_library(EngineOperator, bpy.types.Operator):
    """Choose the folder of meshes in which the next Refine looks for the shapes of objects"""

    bl_idname = "r2sego.choose_mesh_library"
    bl_label = "Mesh Library"
    bl_options = {"REGISTER"}

    directory: StringProperty(
        name="Folder", description="The folder of meshes", subtype="DIR_PATH", options={"SKIP_SAVE"}
    )
    filter_folder: BoolProperty(default=True, options={"HIDDEN"})
    withdraw: BoolProperty(name="Withdraw", description="Look in no folder any more", options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        return needs_bundle(cls, context) and needs_idle_engine(cls)

    @classmethod
    def description(cls, context, properties):
        if not properties.withdraw:
            return cls.__doc__
        return f"Look for shapes in {context.scene.r2sego_proxy.library} no more. The folder itself stays"

    def invoke(self, context, event):
        if self.withdraw:
            return self.execute(context)
        self.directory = self.directory or context.scene.r2sego_proxy.library
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def arguments(self, context):
        command = ["objects", str(state.opened_bundle(context).path), "--json"]
        if self.withdraw:
            return [*command, "--no-library"]
        if not self.directory:
            raise GeometryError("no folder of meshes is chosen", cure="Choose one, or withdraw the library.")
        return [*command, "--library", bpy.path.abspath(self.directory)]

    def finish(self, context, result):
        state.refresh(context.scene)
        return "Library withdrawn" if self.withdraw else "Library chosen: the next Refine looks for shapes in it"

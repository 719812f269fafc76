"""Export the scene for simulators."""

import bpy
from bpy.props import StringProperty

from ...r2sego_blender.errors import SceneError
from .. import state
from ..base import EngineOperator, needs_bundle, needs_idle_engine


class R2SEGO_OT_export_collision(EngineOperator, bpy.types.Operator):
    """Copy the collision surface (mesh, convex pieces, MJCF), the asset and the proxy to a folder"""

    bl_idname = "r2sego.export_collision"
    bl_label = "Export for Simulation"
    bl_options = {"REGISTER"}

    directory: StringProperty(
        name="Folder", description="The folder to write, made if it is missing", subtype="DIR_PATH"
    )
    filter_folder: bpy.props.BoolProperty(default=True, options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        if not (needs_bundle(cls, context) and needs_idle_engine(cls)):
            return False
        if not context.scene.r2sego.has_collision:
            cls.poll_message_set("There is no collision surface yet: run Refine first")
            return False
        return True

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def arguments(self, context):
        if not self.directory:
            raise SceneError("no folder is chosen", cure="Choose where to export to.")
        return ["export", str(state.opened_bundle(context).path), "--to", bpy.path.abspath(self.directory)]

    def finish(self, context, result):
        return f"Exported to {self.directory}"

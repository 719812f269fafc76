"""Export the scene for simulators."""

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from ...r2sego_blender.core.errors import SceneError
from ...r2sego_blender.splats.formats.registry import MENU
from .. import state
from ..base import EngineOperator, needs_idle_engine
from .polls import needs_collision

_SPLATS = tuple(
    (suffix, label, f"The asset as {suffix} too. {keeps}") for suffix, label, keeps in MENU if suffix != ".ply"
)


class R2SEGO_OT_export_collision(EngineOperator, bpy.types.Operator):
    """Copy the collision surface (mesh, pieces, MJCF, URDF, SDF, USD), asset, proxy, cameras to a folder"""

    bl_idname = "r2sego.export_collision"
    bl_label = "Export for Simulation"
    bl_options = {"REGISTER"}

    directory: StringProperty(
        name="Folder", description="The folder to write, made if it is missing", subtype="DIR_PATH"
    )
    filter_folder: BoolProperty(default=True, options={"HIDDEN"})
    splats: EnumProperty(
        name="Splats",
        description="Formats of the asset beside its PLY",
        items=_SPLATS,
        options={"ENUM_FLAG"},
        default=set(),
    )
    textured: BoolProperty(
        name="Textured",
        description="The proxy with baked colours too, for cameras in MuJoCo and Isaac Sim; takes minutes",
    )

    @classmethod
    def poll(cls, context):
        return needs_collision(cls, context) and needs_idle_engine(cls)

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def arguments(self, context):
        if not self.directory:
            raise SceneError("no folder is chosen", cure="Choose where to export to.")
        folder = bpy.path.abspath(self.directory)
        command = ["export", str(state.opened_bundle(context).path), "--to", folder, "--json-progress"]
        chosen = [suffix for suffix, *_ in _SPLATS if suffix in self.splats]
        if chosen:
            command += ["--splats", ",".join(chosen)]
        return [*command, "--textured"] if self.textured else command

    def finish(self, context, result):
        return f"Exported to {self.directory}"

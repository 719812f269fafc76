"""The demo room, made and refined in one click."""

from pathlib import Path

import bpy
from bpy.props import EnumProperty, StringProperty

from ...r2sego_blender.bridge.bundle import SUFFIX, Bundle
from ...r2sego_blender.settings import PRESETS
from .. import state
from ..base import EngineOperator, needs_idle_engine


class R2SEGO_OT_demo_scene(EngineOperator, bpy.types.Operator):
    """Make a scene of the demo room that comes along, and refine it: a first look in some minutes"""

    bl_idname = "r2sego.demo_scene"
    bl_label = "Demo Scene"
    bl_options = {"REGISTER"}

    directory: StringProperty(
        name="Folder", subtype="DIR_PATH",
        description="Where the scene bundle is made; empty = the folder of the person's documents",
    )  # fmt: skip
    preset: EnumProperty(
        name="Preset", description="Named settings of the refinement", default="preview",
        items=[(name, name.capitalize(), "") for name in PRESETS],
    )  # fmt: skip

    @classmethod
    def poll(cls, context):
        return needs_idle_engine(cls)

    def invoke(self, context, event):
        if not self.directory:
            self.directory = str(_documents())
        return context.window_manager.invoke_props_dialog(self, width=420)

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(self, "directory")
        layout.prop(self, "preset")

    def arguments(self, context):
        return ["demo", str(self._bundle_path()), "--preset", self.preset, "--json-progress"]

    def finish(self, context, result):
        bundle = Bundle.open(self._bundle_path())
        state.show_bundle(context.scene, bundle)
        made = f"Made and refined {bundle.path.name}"
        try:
            bpy.ops.r2sego.import_captures()
            bpy.ops.r2sego.show_proxy()
        except RuntimeError as error:  # the scene is made all the same
            return f"{made}, but showing it failed: {str(error).strip().splitlines()[-1]}"
        return made

    def _bundle_path(self):
        folder = Path(bpy.path.abspath(self.directory)).absolute() if self.directory else _documents()
        return folder / f"demo_room{SUFFIX}"


def _documents() -> Path:
    documents = Path.home() / "Documents"
    return documents if documents.is_dir() else Path.home()

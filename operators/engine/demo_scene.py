"""The demo room, made and refined in one click."""

from pathlib import Path

import bpy
from bpy.props import EnumProperty, StringProperty

from ...r2sego_blender.core.errors import R2SEgoError
from ...r2sego_blender.results.panels.bundle import SUFFIX, Bundle
from ...r2sego_blender.workers.jobs import Job
from .. import state
from ..base import EngineOperator, needs_idle_engine, needs_own_scene
from ..room_view import look_into_room

_TAKES = "Takes some minutes, Paper 15 and more; Blender stays free meanwhile"


class R2SEGO_OT_demo_scene(EngineOperator, bpy.types.Operator):
    """Make a scene of the demo room that comes along, and refine it: a first look at a whole scene"""

    bl_idname = "r2sego.demo_scene"
    bl_label = "Demo Scene"
    bl_options = {"REGISTER"}

    directory: StringProperty(
        name="Folder", subtype="DIR_PATH", description="Where the scene bundle is made; empty = your documents folder"
    )
    preset: EnumProperty(
        name="Preset", description="Named settings of the refinement", default="preview", items=state.PRESET_ITEMS
    )

    @classmethod
    def poll(cls, context):
        return needs_own_scene(cls, context) and needs_idle_engine(cls)

    def invoke(self, context, event):
        if not self.directory:
            self.directory = str(_documents())
        return context.window_manager.invoke_props_dialog(self, width=420, confirm_text="Make and Refine")

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(self, "directory")
        layout.prop(self, "preset")
        layout.label(text=_TAKES, icon="TIME")

    def arguments(self, context):
        return ["demo", str(self._bundle_path()), "--preset", self.preset, "--json-progress"]

    def finish(self, context, result):
        bundle = Bundle.open(self._bundle_path())
        opened_before = state.bundle_path(context.scene) == str(bundle.path)
        state.show_bundle(context.scene, bundle)
        made = f"Made and refined {bundle.path.name}"
        try:
            if not opened_before:
                _show_captures(context, bundle)
            bpy.ops.r2sego.show_asset()
            context.scene.r2sego_captures.show_cloud = False  # which would lie over the splats
        except (R2SEgoError, RuntimeError) as error:  # the scene is made all the same
            return f"{made}, but showing it failed: {str(error).strip().splitlines()[-1]}"
        return made

    def _bundle_path(self):
        return _bundle_in(self.directory)


def open_begun(context: bpy.types.Context, job: Job) -> None:
    """Open the bundle of a running *Demo Scene* once it is there, and show its captures.

    Where another bundle is open nothing happens. Raises R2SEgoError when the bundle is damaged,
    RuntimeError when the captures cannot be shown.
    """
    if context.scene.r2sego.bundle or job.notes.get("operator") != R2SEGO_OT_demo_scene.bl_idname:
        return
    path = _bundle_in(job.notes.get("properties", {}).get("directory", ""))
    if (path / "captures" / "sparse.npz").is_file():
        bundle = Bundle.open(path)
        state.show_bundle(context.scene, bundle)
        _show_captures(context, bundle)


def _show_captures(context: bpy.types.Context, bundle: Bundle) -> None:
    """The captures' cameras, in a view that looks into their room."""
    bpy.ops.r2sego.import_captures()
    look_into_room(context.scene, bundle)


def _bundle_in(directory: str) -> Path:
    folder = Path(bpy.path.abspath(directory)).absolute() if directory else _documents()
    return folder / f"demo_room{SUFFIX}"


def _documents() -> Path:
    documents = Path.home() / "Documents"
    return documents if documents.is_dir() else Path.home()

"""Open a scene bundle."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty

from ...r2sego_blender.bundle.layout import DECLARATION
from ...r2sego_blender.core.errors import SceneError
from ...r2sego_blender.results.panels.bundle import Bundle
from .. import state
from ..base import ReportingOperator, needs_own_scene
from ..room_view import show_room


class R2SEGO_OT_open_scene(ReportingOperator, bpy.types.Operator):
    """Open a scene bundle, and show its room and its newest splats in the 3D views"""

    bl_idname = "r2sego.open_scene"
    bl_label = "Open Scene"
    bl_options = {"REGISTER", "UNDO"}

    directory: StringProperty(
        name="Bundle", description="The bundle, a folder that ends in .r2s", subtype="DIR_PATH", options={"SKIP_SAVE"}
    )
    show: BoolProperty(
        name="Show", description="Look into the room in the 3D views, and show its newest splats", default=True
    )
    filter_folder: BoolProperty(default=True, options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        return needs_own_scene(cls, context)

    def invoke(self, context, event):
        if self.directory:  # its scene.toml was dropped
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def perform(self, context):
        if not self.directory:
            raise SceneError("no bundle is chosen", cure="Choose a folder that ends in .r2s.")
        bundle = Bundle.open(_bundle_at(Path(bpy.path.abspath(self.directory))))
        opened_before = state.bundle_path(context.scene) == str(bundle.path)
        state.show_bundle(context.scene, bundle)
        failed = show_room(context.scene, bundle) if self.show and not opened_before else ""
        return f"Opened {bundle.name}{failed}"


def _bundle_at(chosen: Path) -> Path:
    """The chosen folder, or the bundle in which a person chose one, or a file."""
    chosen = chosen.absolute()
    if ".." in chosen.parts:  # a bundle has one path, by which what is shown of it is known
        chosen = chosen.resolve()
    for folder in (chosen, *chosen.parents):
        if (folder / DECLARATION).is_file():
            return folder
    raise SceneError(
        "this is not a scene bundle",
        where=chosen,
        cure="Choose a folder that ends in .r2s, or make one with New Scene.",
    )


class R2SEGO_FH_scene(bpy.types.FileHandler):
    """A bundle's scene.toml, dropped into the 3D view, opens the bundle"""

    bl_idname = "R2SEGO_FH_scene"
    bl_label = "R2S-EGO Scene"
    bl_import_operator = R2SEGO_OT_open_scene.bl_idname
    bl_file_extensions = ".toml"

    @classmethod
    def poll_drop(cls, context):
        """In the 3D view alone."""
        return context.area is not None and context.area.type == "VIEW_3D"

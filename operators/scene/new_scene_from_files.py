"""Begin a new scene with dropped photographs, a video or poses."""

from pathlib import Path

import bpy
from bpy.props import CollectionProperty, StringProperty

from ...r2sego_blender.bridge.shared.reports import reported
from ...r2sego_blender.captures.poses.dropped_files import ARCHIVES, PHOTOGRAPHS, VIDEOS, capture_files, taken_besides
from ...r2sego_blender.core.errors import R2SEgoError
from ...r2sego_blender.results.panels.bundle import SUFFIX
from ..base import needs_idle_engine, needs_own_scene, told


class R2SEGO_OT_new_scene_from_files(bpy.types.Operator):
    """Make a scene bundle from photographs, a video, transforms.json, cameras.json or a COLMAP model"""

    bl_idname = "r2sego.new_scene_from_files"
    bl_label = "New Scene from Files"
    bl_options = {"REGISTER"}

    directory: StringProperty(
        name="Folder",
        description="The folder of the files, or of the photographs",
        subtype="DIR_PATH",
        options={"SKIP_SAVE"},
    )
    files: CollectionProperty(
        name="Files",
        description="Photographs, a video or poses in that folder; none = the folder itself",
        type=bpy.types.OperatorFileListElement,
        options={"SKIP_SAVE", "HIDDEN"},
    )
    scene: StringProperty(
        name="Scene",
        description="The bundle to make; empty = beside the photographs",
        subtype="FILE_PATH",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context):
        return needs_own_scene(cls, context) and needs_idle_engine(cls)

    def invoke(self, context, event):
        return self._new_scene(context, "INVOKE_DEFAULT")

    def execute(self, context):
        return self._new_scene(context, "EXEC_DEFAULT")

    def _new_scene(self, context, how):
        """New Scene with what was dropped filled in: asked for with a window, made without."""
        try:
            folder = Path(bpy.path.abspath(self.directory)).absolute()
            dropped = [folder / one.name for one in self.files if one.name]
            found = capture_files(dropped or [folder], SUFFIX)
            more = taken_besides(dropped, found.photographs)
        except (R2SEgoError, OSError) as error:
            self.report({"ERROR"}, told(error))
            return {"CANCELLED"}
        if more:
            self.report({"WARNING"}, more)
        given = {
            "filepath": self.scene or str(found.scene),
            "captures": "" if found.photographs is None else str(found.photographs),
            "poses": "" if found.poses is None else str(found.poses),
        }
        try:
            ended = bpy.ops.r2sego.new_scene(how, **given)
        except RuntimeError as error:  # what New Scene reported
            self.report({"ERROR"}, reported(error))
            return {"CANCELLED"}
        return {"CANCELLED"} if ended == {"CANCELLED"} else {"FINISHED"}


class R2SEGO_FH_captures(bpy.types.FileHandler):
    """Photographs, a video or poses, dropped into the 3D view, begin a new scene"""

    bl_idname = "R2SEGO_FH_captures"
    bl_label = "R2S-EGO Captures"
    bl_import_operator = R2SEGO_OT_new_scene_from_files.bl_idname
    bl_file_extensions = ";".join((*PHOTOGRAPHS, *VIDEOS, *ARCHIVES, ".json", ".bin", ".txt", ".csv"))

    @classmethod
    def poll_drop(cls, context):
        """In the 3D view alone."""
        return context.area is not None and context.area.type == "VIEW_3D"

"""Write the asset as a file that other programs read."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from ...r2sego_blender.bundle.asset_stages import stage_named
from ...r2sego_blender.core.errors import AssetError, R2SEgoError
from ...r2sego_blender.splats.formats.registry import MENU, SUFFIXES
from .. import state
from ..base import EngineOperator, needs_idle_engine, told
from .polls import needs_asset


class R2SEGO_OT_export_asset(EngineOperator, bpy.types.Operator):
    """Write the asset's splats in a format of other programs"""

    bl_idname = "r2sego.export_asset"
    bl_label = "Export Asset"
    bl_options = {"REGISTER"}

    filepath: StringProperty(name="File", description="The file to write", subtype="FILE_PATH", options={"SKIP_SAVE"})
    check_existing: BoolProperty(default=True, options={"HIDDEN"})
    filter_glob: StringProperty(default=";".join(f"*{suffix}" for suffix, *_ in MENU), options={"HIDDEN"})
    file_format: EnumProperty(
        name="Format", description="Gives the file its suffix; by default the name's own counts", items=MENU
    )
    stage: StringProperty(
        name="Asset", description="initial, a round's number, or final; empty = the final one", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context):
        return needs_asset(cls, context) and needs_idle_engine(cls)

    def invoke(self, context, event):
        if not self.filepath:
            try:
                self.filepath = f"{state.opened_bundle(context).name}{self.file_format}"
            except (R2SEgoError, OSError) as error:
                self.report({"ERROR"}, told(error))
                return {"CANCELLED"}
        self._seen_format = self.file_format
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def check(self, context):
        """Show the name that is written, by which Blender tells whether there is such a file.

        Of the name's suffix and the format, that counts which was changed.
        """
        shown, seen_format = self.filepath, self._seen_format
        typed = Path(shown).suffix.lower()
        if self.file_format == seen_format and typed in (suffix for suffix, *_ in MENU):
            self.file_format = typed
        self._seen_format = self.file_format
        if Path(shown).name and not Path(bpy.path.abspath(shown)).is_dir():
            self.filepath = str(self._file())
        return self.filepath != shown or self.file_format != seen_format

    def arguments(self, context):
        if not self.filepath:
            raise AssetError("no file is chosen", cure="Choose where to write the asset.")
        if Path(bpy.path.abspath(self.filepath)).is_dir():
            raise AssetError("this is a folder", where=self.filepath, cure="Name a file in it.")
        bundle = state.opened_bundle(context)
        stages = context.scene.r2sego_asset.stages
        stage = stage_named(bundle.scene, self.stage or stages[len(stages) - 1].name)
        return ["convert", str(stage.file), str(self._file())]

    def finish(self, context, result):
        return f"Wrote {self._file()}"

    def _file(self) -> Path:
        file = Path(bpy.path.abspath(self.filepath))
        if file.suffix.lower() not in SUFFIXES:
            return file.with_name(file.name + self.file_format)
        return file.with_suffix(self.file_format) if self.properties.is_property_set("file_format") else file

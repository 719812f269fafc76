"""Install the engine into an environment of the extension's own."""

import sys
from pathlib import Path

import bpy
from bpy.props import StringProperty

from ...r2sego_blender.bridge.engine.user_folder import engine_folder
from ...r2sego_blender.bridge.shared.engine_python import addon_preferences, examine
from ...r2sego_blender.core.errors import MachineError
from ...r2sego_blender.results.doctor import PACKAGES, REQUIRED_MB
from ...r2sego_blender.workers.environment import DOWNLOAD_MB, not_packaged, python_of
from .. import job
from ..base import EngineOperator, needs_idle_engine

_TRANSLOCATED = "/AppTranslocation/"  # where macOS puts what was downloaded and not moved since
_LISTED = 10  # the largest packages, which are most of it


class R2SEGO_OT_set_up_engine(EngineOperator, bpy.types.Operator):
    """Install the engine's packages into a folder of this extension; shows which and how large, and asks"""

    bl_idname = "r2sego.set_up_engine"
    bl_label = "Set Up Engine"
    bl_options = {"REGISTER"}

    wheels: StringProperty(
        name="Wheel Folder",
        subtype="DIR_PATH",
        description="Folder of downloaded wheels, for a machine without a network; empty = the package index",
    )

    @classmethod
    def poll(cls, context):
        return needs_idle_engine(cls)

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self, width=520, confirm_text="Install")

    def draw(self, context):
        layout = self.layout
        layout.label(text=f"{DOWNLOAD_MB} MB are downloaded, {REQUIRED_MB} MB are taken on the disk:")
        needed = sorted((p for p in PACKAGES if p.required), key=lambda package: -package.size_mb)
        column = layout.column(align=True)
        for package in needed[:_LISTED]:
            row = column.split(factor=0.45)
            row.label(text=f"{package.name}, {package.size_mb} MB")
            row.label(text=package.purpose)
        rest_mb = sum(package.size_mb for package in needed[_LISTED:])
        column.label(text=f"and {len(needed) - _LISTED} smaller ones, {rest_mb} MB")
        layout.prop(self, "wheels")
        if not self.wheels and (reason := not_packaged()):
            layout.label(text=reason[0].upper() + reason[1:], icon="ERROR")
        if not (self.wheels or bpy.app.online_access):
            box = layout.box()
            box.label(text="Blender may not go online: allow it, or choose a folder of wheels", icon="ERROR")
            box.prop(context.preferences.system, "use_online_access")

    def start(self, context):
        if not (self.wheels or bpy.app.online_access):
            raise MachineError(
                "online access is not allowed",
                where="Preferences > System",
                cure="Allow it there, or choose a folder of wheels.",
            )
        if _TRANSLOCATED in sys.executable:
            raise MachineError(
                "macOS runs this Blender from a place that is gone when it ends, and the engine needs it",
                cure="Move Blender to Applications, start it there, then try again.",
            )
        return job.start(
            self, self.arguments(context), python=sys.executable, module="workers.environment", of_scene=False
        )

    def arguments(self, context):
        wheels = ["--wheels", str(Path(bpy.path.abspath(self.wheels)).absolute())] if self.wheels else []
        return [str(engine_folder()), "--needed-mb", str(REQUIRED_MB), *wheels]

    def finish(self, context, result):
        python = str(python_of(engine_folder()))  # by its place, whatever was told
        preferences = addon_preferences()
        if preferences is None:  # a script on a checkout
            return f"The engine's Python is {python}: name it in R2SEGO_PYTHON"
        preferences.engine_python = python
        context.preferences.is_dirty = True  # so that Blender saves them
        line = context.window_manager.r2sego_engine.found = examine()
        return line

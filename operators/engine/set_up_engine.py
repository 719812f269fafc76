"""Install the engine into an environment of the extension's own."""

import sys
from pathlib import Path

import bpy
from bpy.props import StringProperty

from ...r2sego_blender.bridge.engine_python import addon_preferences, examine
from ...r2sego_blender.doctor import PACKAGES
from ...r2sego_blender.errors import MachineError
from ...r2sego_blender.workers.environment import required_packages
from .. import job
from ..base import EngineOperator, needs_idle_engine

_ROOT = __package__.rsplit(".", 2)[0]


class R2SEGO_OT_set_up_engine(EngineOperator, bpy.types.Operator):
    """Install the engine's packages into a folder of this extension; asks before it starts"""

    bl_idname = "r2sego.set_up_engine"
    bl_label = "Set Up Engine"
    bl_options = {"REGISTER"}

    wheels: StringProperty(
        name="Wheel Folder", subtype="DIR_PATH",
        description="Folder of downloaded wheels, for a machine without a network; empty = the package index",
    )  # fmt: skip

    @classmethod
    def poll(cls, context):
        return needs_idle_engine(cls)

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self, width=420)

    def draw(self, context):
        layout = self.layout
        size_mb = sum(package.size_mb for package in PACKAGES if package.required)
        layout.label(text=f"Installs {len(required_packages())} packages, about {size_mb} MB on disk:")
        column = layout.column(align=True)
        for package in PACKAGES:
            if package.required:
                column.label(text=f"{package.name}, {package.size_mb} MB: {package.purpose}")
        layout.prop(self, "wheels")
        if not (self.wheels or bpy.app.online_access):
            layout.label(text="Allow online access in the preferences, or choose wheels", icon="ERROR")

    def start(self, context):
        if not (self.wheels or bpy.app.online_access):
            raise MachineError(
                "online access is not allowed", where="Preferences > System",
                cure="Allow it there, or choose a folder of wheels.",
            )  # fmt: skip
        return job.start(self, self.arguments(context), python=sys.executable, module="workers.environment")

    def arguments(self, context):
        folder = Path(bpy.utils.extension_path_user(_ROOT, path="engine", create=True))
        return [str(folder), *(["--wheels", bpy.path.abspath(self.wheels)] if self.wheels else [])]

    def finish(self, context, result):
        preferences = addon_preferences()
        preferences.engine_python = result["python"]
        preferences.engine_found = examine()
        return preferences.engine_found

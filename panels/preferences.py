"""The add-on's preferences: which Python runs the engine."""

import bpy
from bpy.props import StringProperty

ROOT = __package__.rpartition(".")[0]


class R2SEGO_AP_preferences(bpy.types.AddonPreferences):
    """Which Python runs the engine"""

    bl_idname = ROOT

    engine_python: StringProperty(
        name="Engine Python", subtype="FILE_PATH",
        description="The python of the environment that has the engine's packages; "
        "empty = the variable R2SEGO_PYTHON",
    )  # fmt: skip
    engine_found: StringProperty(options={"SKIP_SAVE"})

    def draw(self, context):
        layout = self.layout
        layout.prop(self, "engine_python")
        row = layout.row()
        row.operator("r2sego.set_up_engine", icon="IMPORT")
        row.operator("r2sego.check_engine", icon="CHECKMARK")
        layout.label(text=self.engine_found or "Not checked yet")


CLASSES = (R2SEGO_AP_preferences,)

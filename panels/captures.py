"""The sub-panel Captures."""

import bpy

from .sidebar import Step


class R2SEGO_PT_captures(Step, bpy.types.Panel):
    """The photographs and their cameras"""

    bl_idname = "R2SEGO_PT_captures"
    bl_label = "Captures"
    bl_order = 1
    section = "captures"

    def draw(self, context):
        self.draw_facts(context)
        row = self.layout.row(align=True)
        row.operator("r2sego.import_captures", text="Import", icon="CAMERA_DATA")
        row.operator("r2sego.look_through", icon="VIEW_CAMERA")


CLASSES = (R2SEGO_PT_captures,)

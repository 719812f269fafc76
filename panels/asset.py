"""The sub-panel Asset."""

import bpy

from .sidebar import Step


class R2SEGO_PT_asset(Step, bpy.types.Panel):
    """The refined visual asset"""

    bl_idname = "R2SEGO_PT_asset"
    bl_label = "Asset"
    bl_order = 6
    section = "asset"

    def draw(self, context):
        self.draw_facts(context)
        self.layout.operator("r2sego.evaluate", icon="VIEWZOOM")


CLASSES = (R2SEGO_PT_asset,)

"""The sub-panel Collision."""

import bpy

from .sidebar import Step


class R2SEGO_PT_collision(Step, bpy.types.Panel):
    """What the robot collides with"""

    bl_idname = "R2SEGO_PT_collision"
    bl_label = "Collision"
    bl_order = 7
    section = "collision"

    def draw(self, context):
        self.draw_facts(context)
        row = self.layout.row(align=True)
        row.operator("r2sego.show_collision", text="Show", icon="MOD_PHYSICS")
        row.operator("r2sego.export_collision", text="Export", icon="EXPORT")


CLASSES = (R2SEGO_PT_collision,)

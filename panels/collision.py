"""The sub-panel Collision: shown, checked in MuJoCo, textured, exported."""

import bpy

from .sidebar import Step, write_facts


class R2SEGO_PT_collision(Step, bpy.types.Panel):
    """What the robot collides with"""

    bl_idname = "R2SEGO_PT_collision"
    bl_label = "Collision"
    bl_order = 7
    section = "collision"

    def draw(self, context):
        self.draw_facts(context)
        group, layout = context.scene.r2sego_collision, self.layout
        row = layout.row(align=True)
        row.operator("r2sego.show_collision", text="Show", icon="MOD_PHYSICS")
        row.operator("r2sego.check_collision", text="Check", icon="CHECKMARK")
        if group.older:
            layout.label(text="Redone since: press Show", icon="INFO")
        if group.checked:
            column = layout.column(align=True)
            icon = "CHECKMARK" if group.passed else "ERROR"
            column.label(text="Passed" if group.passed else "Not passed", icon=icon)
            write_facts(context, column, [(fact.name, fact.value) for fact in group.check])
        row = layout.row(align=True)
        row.operator("r2sego.texture_proxy", text="Texture", icon="TEXTURE")
        row.operator("r2sego.export_collision", text="Export", icon="EXPORT")
        column = layout.column(align=True)
        write_facts(context, column, [(fact.name, fact.value) for fact in group.texture])


CLASSES = (R2SEGO_PT_collision,)

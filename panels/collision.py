"""The sub-panel Collision: shown, checked in MuJoCo, textured, exported."""

import textwrap

import bpy

from .sidebar import Step, fitting_characters


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
        row.operator("r2sego.check_collision", icon="CHECKMARK")
        if group.checked:
            column = layout.column(align=True)
            icon = "CHECKMARK" if group.passed else "ERROR"
            column.label(text="Passed" if group.passed else "Not passed", icon=icon)
            _lines(context, column, group.check)
        row = layout.row(align=True)
        row.operator("r2sego.texture_proxy", icon="TEXTURE")
        row.operator("r2sego.export_collision", text="Export", icon="EXPORT")
        _lines(context, layout.column(align=True), group.texture)


def _lines(context, column, facts):
    """Labels and values, wrapped."""
    for fact in facts:
        label = fact.name
        for text in textwrap.wrap(fact.value, fitting_characters(context, 0.68)):
            row = column.split(factor=0.32)
            name = row.row()
            name.active = False
            name.label(text=label)
            row.label(text=text)
            label = ""


CLASSES = (R2SEGO_PT_collision,)

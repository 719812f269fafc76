"""The sub-panel Report."""

import bpy

from .sidebar import Step


class R2SEGO_PT_report(Step, bpy.types.Panel):
    """Scores on frozen views"""

    bl_idname = "R2SEGO_PT_report"
    bl_label = "Report"
    bl_order = 8
    section = "report"

    def draw(self, context):
        self.draw_facts(context)
        self.layout.operator("r2sego.open_report", icon="URL")


CLASSES = (R2SEGO_PT_report,)

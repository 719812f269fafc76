"""The sub-panel Generation."""

import bpy

from .sidebar import Step


class R2SEGO_PT_generation(Step, bpy.types.Panel):
    """Conditions, clips and the frames that were kept"""

    bl_idname = "R2SEGO_PT_generation"
    bl_label = "Generation"
    bl_order = 5
    section = "generation"

    def draw(self, context):
        self.draw_facts(context)
        self.layout.operator("r2sego.render_conditions", text="Conditions", icon="RENDER_ANIMATION")


CLASSES = (R2SEGO_PT_generation,)

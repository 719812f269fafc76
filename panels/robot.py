"""The sub-panel Robot."""

import bpy

from .sidebar import Step


class R2SEGO_PT_robot(Step, bpy.types.Panel):
    """The robot, its behaviour scope and the rollouts"""

    bl_idname = "R2SEGO_PT_robot"
    bl_label = "Robot"
    bl_order = 3
    section = "robot"

    def draw(self, context):
        self.draw_facts(context)


CLASSES = (R2SEGO_PT_robot,)

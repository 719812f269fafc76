"""The sub-panel Geometry Proxy."""

import bpy

from .sidebar import Step


class R2SEGO_PT_proxy(Step, bpy.types.Panel):
    """The geometry proxy of a round"""

    bl_idname = "R2SEGO_PT_proxy"
    bl_label = "Geometry Proxy"
    bl_order = 2
    section = "proxy"

    def draw(self, context):
        self.draw_facts(context)
        row = self.layout.row(align=True)
        row.prop(context.scene.r2sego, "round_index")
        row.operator("r2sego.show_proxy", text="Show", icon="MESH_DATA")


CLASSES = (R2SEGO_PT_proxy,)

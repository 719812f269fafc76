"""The sub-panel Views."""

import bpy

from .sidebar import Step


class R2SEGO_PT_views(Step, bpy.types.Panel):
    """Candidate and target views of a round"""

    bl_idname = "R2SEGO_PT_views"
    bl_label = "Views"
    bl_order = 4
    section = "views"

    def draw(self, context):
        self.draw_facts(context)
        row = self.layout.row(align=True)
        row.prop(context.scene.r2sego, "round_index")
        row.operator("r2sego.show_candidates", text="Show", icon="OUTLINER_OB_CAMERA")
        row = self.layout.row(align=True)
        row.operator("r2sego.look_through", icon="VIEW_CAMERA")


CLASSES = (R2SEGO_PT_views,)

"""The sub-panel Scene."""

import bpy

from ..r2sego_blender.results.panels.scene_choices import what_refine_does
from .sidebar import Step


class R2SEGO_PT_scene(Step, bpy.types.Panel):
    """The scene bundle"""

    bl_idname = "R2SEGO_PT_scene"
    bl_label = "Scene"
    bl_order = 0
    section = "scene"

    def draw(self, context):
        layout = self.layout
        scene = context.scene.r2sego
        row = layout.row(align=True)
        row.operator("r2sego.new_scene", text="New", icon="FILE_NEW")
        row.operator("r2sego.open_scene", text="Open", icon="FILE_FOLDER")
        if not scene.bundle:
            return
        row = layout.row(align=True)
        row.label(text=bpy.path.basename(scene.bundle.rstrip("/\\")), icon="PACKAGE")
        row.operator("r2sego.refresh_scene", text="", icon="FILE_REFRESH")
        self.draw_facts(context)
        summary = context.scene.r2sego_report.summary
        if summary:
            layout.label(text=summary, icon="GRAPH")
        layout.prop(scene, "preset")
        rounds = scene.rounds_begun, scene.rounds_done, scene.rounds_declared
        layout.label(text=what_refine_does(*rounds), icon="INFO")
        column = layout.column()
        column.scale_y = 1.2
        column.operator("r2sego.refine", icon="PLAY")


CLASSES = (R2SEGO_PT_scene,)

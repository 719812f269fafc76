"""The side bar's tab, its sub-panels in the order of the work. They draw cached facts only."""

import textwrap
from itertools import zip_longest

import bpy

_LABEL_SHARE = 0.29
_CHARACTER_PX = 8.2  # of Blender's interface font at scale 1, margins included


class _Sidebar:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "R2S-EGO"


class _Step(_Sidebar):
    """A sub-panel; ``section`` names the facts it shows."""

    bl_parent_id = "R2SEGO_PT_main"
    section = ""

    def draw_facts(self, context):
        facts = [fact for fact in context.scene.r2sego.facts if fact.section == self.section]
        if not facts:
            return
        fitting = _fitting_characters(context, 1.0 - _LABEL_SHARE)
        column = self.layout.column(align=True)
        for fact in facts:
            label = fact.label
            for line in textwrap.wrap(fact.value, fitting):
                row = column.split(factor=_LABEL_SHARE)
                name = row.row()
                name.active = False
                name.label(text=label)
                row.label(text=line)
                label = ""  # further lines stand under the first


def _fitting_characters(context, share):
    """How many characters fit in this share of the side bar, roughly."""
    scale = context.preferences.system.ui_scale
    return max(12, int(share * context.region.width / (_CHARACTER_PX * scale)))


class R2SEGO_PT_main(_Sidebar, bpy.types.Panel):
    """The open bundle and what the engine is doing"""

    bl_idname = "R2SEGO_PT_main"
    bl_label = "R2S-EGO"

    def draw(self, context):
        layout = self.layout
        job = context.window_manager.r2sego_job
        if job.running:
            column = layout.column(align=True)
            column.label(text=job.title)
            column.progress(factor=job.fraction, text=job.task)
            if job.message:
                column.label(text=job.message)
            column.operator("r2sego.cancel", icon="CANCEL")
        if context.scene.r2sego.problem:
            box = layout.box()
            box.alert = True
            lines = textwrap.wrap(context.scene.r2sego.problem, _fitting_characters(context, 0.85))
            for line, icon in zip_longest(lines, ["ERROR"], fillvalue="BLANK1"):
                box.label(text=line, icon=icon)


class R2SEGO_PT_scene(_Step, bpy.types.Panel):
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
        column = layout.column()
        column.prop(scene, "preset")
        column.scale_y = 1.2
        column.operator("r2sego.refine", icon="PLAY")


class R2SEGO_PT_captures(_Step, bpy.types.Panel):
    """The photographs and their cameras"""

    bl_idname = "R2SEGO_PT_captures"
    bl_label = "Captures"
    bl_order = 1
    section = "captures"

    def draw(self, context):
        self.draw_facts(context)
        row = self.layout.row(align=True)
        row.operator("r2sego.import_captures", text="Import", icon="CAMERA_DATA")
        row.operator("r2sego.look_through", icon="VIEW_CAMERA")


class R2SEGO_PT_proxy(_Step, bpy.types.Panel):
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


class R2SEGO_PT_robot(_Step, bpy.types.Panel):
    """The robot, its behaviour scope and the rollouts"""

    bl_idname = "R2SEGO_PT_robot"
    bl_label = "Robot"
    bl_order = 3
    section = "robot"

    def draw(self, context):
        self.draw_facts(context)


class R2SEGO_PT_views(_Step, bpy.types.Panel):
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
        row.operator("r2sego.render_conditions", text="Conditions", icon="RENDER_ANIMATION")


class R2SEGO_PT_asset(_Step, bpy.types.Panel):
    """The refined visual asset"""

    bl_idname = "R2SEGO_PT_asset"
    bl_label = "Asset"
    bl_order = 5
    section = "asset"

    def draw(self, context):
        self.draw_facts(context)
        self.layout.operator("r2sego.evaluate", icon="VIEWZOOM")


class R2SEGO_PT_collision(_Step, bpy.types.Panel):
    """What the robot collides with"""

    bl_idname = "R2SEGO_PT_collision"
    bl_label = "Collision"
    bl_order = 6
    section = "collision"

    def draw(self, context):
        self.draw_facts(context)
        row = self.layout.row(align=True)
        row.operator("r2sego.show_collision", text="Show", icon="MOD_PHYSICS")
        row.operator("r2sego.export_collision", text="Export", icon="EXPORT")


class R2SEGO_PT_report(_Step, bpy.types.Panel):
    """Scores on frozen views"""

    bl_idname = "R2SEGO_PT_report"
    bl_label = "Report"
    bl_order = 7
    section = "report"

    def draw(self, context):
        self.draw_facts(context)
        self.layout.operator("r2sego.open_report", icon="URL")


CLASSES = (
    R2SEGO_PT_main,
    R2SEGO_PT_scene,
    R2SEGO_PT_captures,
    R2SEGO_PT_proxy,
    R2SEGO_PT_robot,
    R2SEGO_PT_views,
    R2SEGO_PT_asset,
    R2SEGO_PT_collision,
    R2SEGO_PT_report,
)

"""The sub-panel Asset: splats shown, rendered, compared, deleted and written."""

import bpy

from ..r2sego_blender.bridge.asset.asset_pictures import is_of_view
from ..r2sego_blender.bridge.asset.show_asset import shows_another
from ..r2sego_blender.core.formatting import counted
from .fact_list import FactList, fact_list
from .overlays import splat_preview, wipe
from .sidebar import Sidebar, Step, write_wrapped


class R2SEGO_PT_asset(Step, bpy.types.Panel):
    """The visual asset, from the initial to the final one"""

    bl_idname = "R2SEGO_PT_asset"
    bl_label = "Asset"
    bl_order = 6
    section = "asset"

    def draw(self, context):
        self.draw_facts(context)
        group, layout = context.scene.r2sego_asset, self.layout
        column = layout.column(align=True)
        if group.stages:
            stage = group.stages[group.stage]
            row = column.row(align=True)
            row.prop(group, "stage", text=stage.label, slider=False)
        column.operator("r2sego.show_asset", icon="POINTCLOUD_DATA")
        if group.stages and shows_another(group.shown, stage.name):
            write_wrapped(context, layout, "Another asset is shown: Show Asset shows this one", "INFO")
        elif group.older:
            write_wrapped(context, layout, "The file has changed since: Show Asset shows it", "INFO")
        row = layout.row(align=True)
        row.operator("r2sego.export_asset", text="Export", icon="EXPORT")
        row.operator("r2sego.evaluate", icon="VIEWZOOM")


class _Part(Sidebar):
    """A closed panel below Asset."""

    bl_parent_id = "R2SEGO_PT_asset"
    bl_options = {"DEFAULT_CLOSED"}


class R2SEGO_PT_asset_preview(_Part, bpy.types.Panel):
    """How the splats are drawn in the 3D views"""

    bl_idname = "R2SEGO_PT_asset_preview"
    bl_label = "Preview"
    bl_order = 0

    def draw_header(self, context):
        self.layout.prop(context.scene.r2sego_asset, "preview", text="")

    def draw(self, context):
        group, layout = context.scene.r2sego_asset, self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.active = group.preview
        layout.row().prop(group, "style", expand=True)
        column = layout.column()
        discs = ("share", "moving_share", "size") if group.style == "DISCS" else ()
        for name in (*discs, "opacity", "backdrop"):
            column.prop(group, name)


class R2SEGO_PT_asset_render(_Part, bpy.types.Panel):
    """Exact renderings of the asset, and two pictures compared"""

    bl_idname = "R2SEGO_PT_asset_render"
    bl_label = "Render and Compare"
    bl_order = 1

    def draw(self, context):
        group, layout = context.scene.r2sego_asset, self.layout
        row = layout.row(align=True)
        render = row.operator("r2sego.render_asset", icon="RENDER_STILL")
        render.place, render.render_pass = "BACKGROUND", group.render_pass
        row.prop(group, "render_pass", text="")
        layout.prop(group, "compare")
        column = layout.column()
        column.active = group.compare
        looked_through = context.scene.camera
        for name, side in (("wipe_left", "LEFT"), ("wipe_right", "RIGHT")):
            column.label(text=f"{side.capitalize()} of the Divider")
            column.template_ID(group, name, open="image.open")
            image = getattr(group, name)
            if image is not None and not is_of_view(image, looked_through):
                column.label(text="Of another view: not drawn", icon="INFO")
            row = column.row(align=True)
            row.operator("r2sego.compare_photograph", text="Photograph", icon="CAMERA_DATA").side = side
            render = row.operator("r2sego.render_asset", text="Render", icon="RENDER_STILL")
            render.place, render.render_pass = side, group.render_pass
            if looked_through is not None:
                render.camera = looked_through.name
        row = column.row(align=True)
        row.prop(group, "wipe")
        row.operator("r2sego.move_wipe", text="", icon="ARROW_LEFTRIGHT")


class R2SEGO_UL_asset_edits(FactList, bpy.types.UIList):
    """The deletions that the bundle keeps"""

    group, facts = "r2sego_asset", "edits"

    def draw_fact(self, layout, group, item, index):
        row = layout.row()
        row.label(text=item.name)
        row.label(text=item.regions)


class R2SEGO_PT_asset_delete(_Part, bpy.types.Panel):
    """Splats marked and deleted; what is deleted stays so when the scene is refined again"""

    bl_idname = "R2SEGO_PT_asset_delete"
    bl_label = "Delete Splats"
    bl_order = 2

    def draw(self, context):
        group, layout = context.scene.r2sego_asset, self.layout
        row = layout.row(align=True)
        row.operator("r2sego.add_splat_box", icon="CUBE")
        row.operator("r2sego.mark_splats_box", icon="SELECT_SET")
        column = layout.column(align=True)
        column.operator("r2sego.mark_splats_lasso", icon="GREASEPENCIL")
        row = column.row(align=True)
        row.prop(group, "near")
        row.prop(group, "far")
        row = layout.row(align=True)
        row.operator("r2sego.mark_selected_splats", icon="VERTEXSEL")
        row.operator("r2sego.mark_floaters", icon="SNAP_FACE_CENTER")
        if group.marks:
            layout.label(text=f"{counted(group.marked, 'splat')} marked")
        row = layout.row(align=True)
        row.operator("r2sego.delete_splats", icon="TRASH")
        row.operator("r2sego.clear_splat_marks", icon="X")
        if group.edits:
            fact_list(layout, R2SEGO_UL_asset_edits, group, "edit_index", rows=2)
            layout.operator("r2sego.restore_splats", text="Restore", icon="LOOP_BACK")


CLASSES = (
    R2SEGO_PT_asset,
    R2SEGO_PT_asset_preview,
    R2SEGO_PT_asset_render,
    R2SEGO_UL_asset_edits,
    R2SEGO_PT_asset_delete,
)


def register() -> None:
    """Start the overlays."""
    splat_preview.register()
    wipe.register()


def unregister() -> None:
    """Stop them."""
    wipe.unregister()
    splat_preview.unregister()

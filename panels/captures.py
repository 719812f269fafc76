"""The sub-panel Captures: the list, how it is shown, and the registration by hand."""

import bpy

from ..r2sego_blender.captures.frame.picks_fit import in_centimetres
from ..r2sego_blender.core.formatting import counted
from .fact_list import FactList, fact_list
from .overlays import sparse_cloud
from .overlays.picture_labels import LABELS
from .overlays.registration_overlay import REGISTRATION
from .sidebar import Step, draw_problem, write_wrapped

_OFF_PX = 2.0
"""A pick that misses by more is drawn as doubtful."""


class R2SEGO_UL_captures(FactList, bpy.types.UIList):
    """The captures: name, lens, measured points and overlapping captures"""

    bl_idname = "R2SEGO_UL_captures"
    group, facts = "r2sego_captures", "captures"

    def draw_fact(self, layout, group, item, index):
        row = layout.split(factor=0.55, align=True)
        row.label(text=item.name.rpartition(".")[0] or item.name, icon="CAMERA_DATA")
        facts = row.row(align=True)
        facts.alert = item.overlaps == 0
        for text in (f"{item.view_deg:.0f}\u00b0", str(item.points), str(item.overlaps)):
            place = facts.row(align=True)
            place.alignment = "RIGHT"
            place.label(text=text)


class R2SEGO_UL_picked_points(bpy.types.UIList):
    """The picked points: name, captures, misses in pixels, and whether they lie on the floor"""

    bl_idname = "R2SEGO_UL_picked_points"

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index):
        row = layout.row(align=True)
        row.prop(item, "name", text="", emboss=False, icon="EMPTY_AXIS")
        told = row.row(align=True)
        told.alignment = "RIGHT"
        placed = item.placed
        off_px = placed.off_px if placed is not None else -1.0
        told.alert = off_px > _OFF_PX
        told.label(text=f"{len(item.views)}x" + (f", {off_px:.1f} px" if off_px >= 0.0 else ""))
        if item.floor and placed is not None:
            told.label(text=in_centimetres(placed.off_floor_m))
        row.prop(item, "floor", text="", icon="MESH_PLANE")


class R2SEGO_PT_captures(Step, bpy.types.Panel):
    """The photographs and their cameras"""

    bl_idname = "R2SEGO_PT_captures"
    bl_label = "Captures"
    bl_order = 1
    section = "captures"

    def draw(self, context):
        layout = self.layout
        shown = context.scene.r2sego_captures
        self.draw_facts(context)
        if len(shown.captures):
            fact_list(layout, R2SEGO_UL_captures, shown, "active_capture", rows=4)
            self._draw_chosen(shown.captures[min(shown.active_capture, len(shown.captures) - 1)])
        row = layout.split(factor=0.36, align=True)
        row.operator("r2sego.import_captures", text="Import", icon="CAMERA_DATA")
        row = row.row(align=True)
        row.operator("r2sego.look_through", icon="VIEW_CAMERA")
        row.operator("r2sego.look_through_next", text="", icon="TRIA_LEFT").backwards = True
        row.operator("r2sego.look_through_next", text="", icon="TRIA_RIGHT").backwards = False
        if shown.older:
            layout.label(text="Corrected since: press Import", icon="INFO")
        row = layout.row(align=True)
        row.prop(shown, "show_photographs", toggle=True, icon="IMAGE_DATA")
        row.prop(shown, "photograph_opacity", text="", slider=True)
        row = layout.row(align=True)
        row.prop(shown, "show_cloud", toggle=True, icon="OUTLINER_OB_POINTCLOUD")
        row.prop(shown, "point_size_px", text="")
        row.prop(shown, "show_labels", text="", icon="FONT_DATA")

    def _draw_chosen(self, capture):
        column = self.layout.column(align=True)
        column.active = False
        column.label(text=f"{capture.width} x {capture.height} px, {capture.view_deg:.1f}\u00b0 wide")
        column.label(text=f"{counted(capture.points, 'point')}, overlaps {counted(capture.overlaps, 'capture')}")


class R2SEGO_PT_registration(Step, bpy.types.Panel):
    """Where the floor lies, which way is up and how long a metre is, by hand"""

    bl_idname = "R2SEGO_PT_registration"
    bl_label = "Registration"
    bl_parent_id = "R2SEGO_PT_captures"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return len(context.scene.r2sego_captures.captures) > 0

    def draw(self, context):
        layout = self.layout
        shown = context.scene.r2sego_captures
        self._draw_points(layout, shown)
        self._draw_lengths(layout, shown)
        self._draw_height(layout, shown)
        write_wrapped(context, layout, shown.fit_said, "INFO")
        write_wrapped(context, layout, shown.fit_warning, "QUESTION")
        if shown.fit_problem:
            draw_problem(context, layout, shown.fit_problem)
        layout.operator("r2sego.correct_registration", text="Correct by Picks", icon="CHECKMARK").by = "PICKS"
        row = layout.row(align=True)
        row.operator("r2sego.place_frame", icon="EMPTY_ARROWS")
        row.operator("r2sego.correct_registration", text="Correct by Frame").by = "FRAME"
        row = layout.row()
        row.operator("r2sego.undo_correction", icon="LOOP_BACK")
        for residual in shown.residuals:
            write_wrapped(context, layout, residual.text, "DOT")

    def _draw_points(self, layout, shown):
        row = layout.row()
        row.template_list(R2SEGO_UL_picked_points.bl_idname, "", shown, "points", shown, "active_point", rows=3)
        column = row.column(align=True)
        column.operator("r2sego.remove_pick", text="", icon="REMOVE")
        column.operator("r2sego.remove_pick", text="", icon="TRASH").everything = True
        column.prop(shown, "show_picks", text="", icon="HIDE_OFF" if shown.show_picks else "HIDE_ON")
        row = layout.row(align=True)
        new = row.operator("r2sego.pick_point", text="New", icon="ADD")
        new.point, new.capture, new.floor = "", "", False
        floor = row.operator("r2sego.pick_point", text="Floor", icon="MESH_PLANE")
        floor.point, floor.capture, floor.floor = "", "", True
        if len(shown.points) > shown.active_point:
            more = row.operator("r2sego.pick_point", text="More", icon="EYEDROPPER")
            more.point, more.capture = shown.points[shown.active_point].name, ""

    def _draw_lengths(self, layout, shown):
        for index, length in enumerate(shown.lengths):
            row = layout.row(align=True)
            row.prop(length, "metres", text=f"{length.start} to {length.end}")
            error_m = length.error_m
            if error_m is not None:
                told = row.row(align=True)
                told.alignment = "RIGHT"
                told.label(text=in_centimetres(error_m))
            row.operator("r2sego.remove_length", text="", icon="X").index = index
        layout.operator("r2sego.add_length", icon="DRIVER_DISTANCE")

    def _draw_height(self, layout, shown):
        row = layout.row(align=True)
        row.prop(shown, "use_camera_height")
        if shown.use_camera_height:
            row.prop(shown, "camera_height", text="")
            layout.prop(shown, "height_capture", icon="CAMERA_DATA")
            if shown.height_error_m:
                layout.label(text=f"Camera height {in_centimetres(shown.height_error_m)}", icon="DOT")


CLASSES = (R2SEGO_UL_captures, R2SEGO_UL_picked_points, R2SEGO_PT_captures, R2SEGO_PT_registration)

_OVERLAYS = (sparse_cloud, LABELS, REGISTRATION)


def register():
    """Start drawing the overlays."""
    for overlay in _OVERLAYS:
        overlay.register()


def unregister():
    """Stop drawing them."""
    for overlay in reversed(_OVERLAYS):
        overlay.unregister()

"""The sub-panel Geometry Proxy: its colours, the objects with their masks and priors, its edits."""

from pathlib import PurePath

import bpy

from ..r2sego_blender.core.formatting import counted
from .fact_list import FactList, fact_list
from .overlays import proxy_legend, swatches
from .overlays.placement_overlay import PLACEMENT
from .sidebar import Sidebar, Step, write_wrapped

_STATE_ICONS = {
    "aligned": "CHECKMARK",
    "accepted": "CHECKMARK",
    "by symmetry": "MOD_MIRROR",
    "locked": "LOCKED",
    "refused": "ERROR",
    "rejected": "X",
    "drawn": "GREASEPENCIL",
    "placed": "OBJECT_ORIGIN",
}


class R2SEGO_PT_proxy(Step, bpy.types.Panel):
    """The geometry proxy of a round"""

    bl_idname = "R2SEGO_PT_proxy"
    bl_label = "Geometry Proxy"
    bl_order = 2
    section = "proxy"

    def draw(self, context):
        self.draw_facts(context)
        group, layout = context.scene.r2sego_proxy, self.layout
        row = layout.row(align=True)
        row.prop(context.scene.r2sego, "round_index")
        row.operator("r2sego.show_proxy", text="Show", icon="MESH_DATA")
        layout.prop(group, "colour_by", text="Colour")
        proxy_legend.draw_legend(layout, group)
        layout.operator("r2sego.measure_coverage", icon="CHECKMARK" if group.has_coverage else "HIDE_OFF")
        layout.operator("r2sego.plan_refine", icon="FILE_REFRESH")
        if group.plan:
            write_wrapped(context, layout, group.plan)


class _Part(Sidebar):
    """A closed panel below Geometry Proxy."""

    bl_parent_id = "R2SEGO_PT_proxy"
    bl_options = {"DEFAULT_CLOSED"}


class R2SEGO_UL_proxy_objects(FactList, bpy.types.UIList):
    """The objects with what became of their priors"""

    group, facts = "r2sego_proxy", "objects"

    def draw_fact(self, layout, group, item, index):
        row = layout.split(factor=0.42)
        row.label(text=item.name, icon=_STATE_ICONS.get(item.state, "DOT"))
        row = row.split(factor=0.62)
        row.label(text=item.state)
        row.label(text=f"{item.iou:.2f}" if item.iou >= 0.0 else counted(item.masks, "mask"))


class R2SEGO_PT_proxy_masks(_Part, bpy.types.Panel):
    """Objects, and their masks on the photographs"""

    bl_idname = "R2SEGO_PT_proxy_masks"
    bl_label = "Objects and Masks"
    bl_order = 0

    def draw(self, context):
        group, layout = context.scene.r2sego_proxy, self.layout
        row = layout.row()
        fact_list(row, R2SEGO_UL_proxy_objects, group, "object_index", rows=3)
        column = row.column(align=True)
        column.operator("r2sego.new_object", text="", icon="ADD")
        column.operator("r2sego.remove_object", text="", icon="REMOVE")
        row = layout.row(align=True)
        row.prop(group, "mask_tool", text="")
        brush = row.row(align=True)
        brush.active = group.mask_tool == "BRUSH"
        brush.prop(group, "brush_radius")
        row = layout.row(align=True)
        row.operator("r2sego.draw_mask", text="Draw", icon="GREASEPENCIL")
        row.operator("r2sego.paint_mask", text="Paint", icon="BRUSH_DATA")
        row = layout.row(align=True)
        row.operator("r2sego.load_masks", text="Load", icon="IMPORT")
        row.operator("r2sego.declare_masks", text="Declare", icon="EXPORT")
        layout.prop(group, "show_outlines")


class R2SEGO_PT_proxy_priors(_Part, bpy.types.Panel):
    """The shape prior of the chosen object"""

    bl_idname = "R2SEGO_PT_proxy_priors"
    bl_label = "Shape Priors"
    bl_order = 1

    def draw(self, context):
        group, layout = context.scene.r2sego_proxy, self.layout
        layout.operator("r2sego.show_priors", icon="MESH_MONKEY")
        row = layout.row(align=True)
        row.operator(
            "r2sego.choose_mesh_library", text=PurePath(group.library).name or "Mesh Library", icon="FILE_FOLDER"
        )
        if group.library:
            row.operator("r2sego.choose_mesh_library", text="", icon="X").withdraw = True
        objects, index = group.objects, group.object_index
        if not 0 <= index < len(objects):
            return
        chosen = objects[index]
        column = layout.column(align=True)
        column.label(text=f"{chosen.name}: {chosen.state}", icon=_STATE_ICONS.get(chosen.state, "DOT"))
        if chosen.energy >= 0.0:
            column.label(text=f"Overlap {chosen.iou:.2f}, energy {chosen.energy:.2f}")
        if chosen.residual_m >= 0.0:
            column.label(text=f"Points {100.0 * chosen.residual_m:.1f} cm off, shape {chosen.shape}")
        write_wrapped(context, column, chosen.why)
        row = layout.row(align=True)
        row.operator("r2sego.place_prior", icon="ORIENTATION_GIMBAL")
        row.operator("r2sego.save_placement", text="Save", icon="FILE_TICK")
        if group.fit_object == chosen.name:
            box = layout.box().column(align=True)
            residual = f", points {100.0 * group.fit_residual:.1f} cm off" if group.fit_residual >= 0.0 else ""
            box.label(text=f"Now: overlap {group.fit_iou:.2f}{residual}")
            write_wrapped(context, box, group.fit_views)
        row = layout.row(align=True)
        for decision, text in (("accept", "Accept"), ("reject", "Reject"), ("reconsider", "By Figures")):
            row.operator("r2sego.decide_prior", text=text).decision = decision
        row = layout.row(align=True)
        row.operator("r2sego.decide_prior", text="Lock", icon="LOCKED").decision = "lock"
        if chosen.placed:
            row.operator("r2sego.decide_prior", text="Unlock", icon="UNLOCKED").decision = "unlock"
        layout.operator_menu_enum("r2sego.use_mesh_as_prior", "place", icon="MESH_DATA")


class R2SEGO_UL_proxy_edits(FactList, bpy.types.UIList):
    """The edits of the proxy that the bundle keeps"""

    group, facts = "r2sego_proxy", "edits"

    def draw_fact(self, layout, group, item, index):
        row = layout.split(factor=0.5)
        row.label(text=item.name)
        row.label(text=f"{item.kind}, {item.area:.2f} m\u00b2")


class R2SEGO_PT_proxy_edits(_Part, bpy.types.Panel):
    """Faces cut away and surfaces drawn; each refinement applies them"""

    bl_idname = "R2SEGO_PT_proxy_edits"
    bl_label = "Edit Proxy"
    bl_order = 2

    def draw(self, context):
        group, layout = context.scene.r2sego_proxy, self.layout
        row = layout.row(align=True)
        row.operator("r2sego.select_proxy_lasso", text="Lasso", icon="GREASEPENCIL")
        row.operator("r2sego.select_proxy_box", text="Box", icon="CUBE")
        layout.prop(group, "farthest")
        layout.operator("r2sego.cut_proxy", icon="TRASH")
        layout.operator("r2sego.draw_proxy_surface", icon="MESH_PLANE")
        if group.edits:
            fact_list(layout, R2SEGO_UL_proxy_edits, group, "edit_index", rows=2)
            layout.operator("r2sego.remove_proxy_edit", icon="LOOP_BACK")


CLASSES = (
    R2SEGO_PT_proxy,
    R2SEGO_UL_proxy_objects,
    R2SEGO_PT_proxy_masks,
    R2SEGO_PT_proxy_priors,
    R2SEGO_UL_proxy_edits,
    R2SEGO_PT_proxy_edits,
)


def register() -> None:
    """Start the overlay, and make the legend's icons."""
    swatches.register()
    PLACEMENT.register()


def unregister() -> None:
    """Stop it."""
    PLACEMENT.unregister()
    swatches.unregister()

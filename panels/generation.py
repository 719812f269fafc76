"""The sub-panel Generation: the generated views, what became of them, and their pictures."""

import bpy

from .fact_list import FactList, fact_list
from .sidebar import Sidebar, Step, write_wrapped

_CONDITIONS = {"DEPTH", "NORMAL", "PROVENANCE", "POINTS"}


class R2SEGO_UL_generated_views(FactList, bpy.types.UIList):
    """The generated views by their rank, those that stand in for rejected ones last"""

    group, facts = "r2sego_generation", "views"

    def draw_fact(self, layout, group, item, index):
        row = layout.row(align=True)
        row.active = item.accepted
        row.label(text=f"{item.rank}   {item.title}", icon="CHECKMARK" if item.accepted else "X")
        if item.by_hand:
            row.label(text="", icon="USER")


class R2SEGO_PT_generation(Step, bpy.types.Panel):
    """Conditions, clips and the frames that were kept"""

    bl_idname = "R2SEGO_PT_generation"
    bl_label = "Generation"
    bl_order = 5
    section = "generation"

    def draw(self, context):
        self.draw_facts(context)
        layout, group = self.layout, context.scene.r2sego_generation
        if not len(group.views):
            layout.operator("r2sego.render_conditions", text="Conditions", icon="RENDER_ANIMATION")
            return
        layout.label(text=f"{group.accepted} of {len(group.views)} views accepted")
        fact_list(layout, R2SEGO_UL_generated_views, group, "active", rows=4, maxrows=12)
        if not 0 <= group.active < len(group.views):
            return
        view = group.views[group.active]
        row = layout.row(align=True)
        for decision, text, icon in (
            ("ACCEPT", "Accept", "CHECKMARK"),
            ("REJECT", "Reject", "X"),
            ("UNDECIDED", "", "LOOP_BACK"),
        ):
            button = row.operator("r2sego.decide_view", text=text, icon=icon)
            button.view, button.decision = view.rank, decision
        write_wrapped(context, layout, f"{view.name}: {view.fate}")


class R2SEGO_PT_generation_view(Sidebar, bpy.types.Panel):
    """How the generated frame was registered to the captures"""

    bl_idname = "R2SEGO_PT_generation_view"
    bl_label = "Registration"
    bl_parent_id = "R2SEGO_PT_generation"
    bl_order = 0
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return _active_view(context) is not None

    def draw(self, context):
        view = _active_view(context)
        for label, value in (
            ("Reference", view.reference),
            ("Agreement", view.registration),
            ("Residual", view.residual),
            ("Uncertainty", view.uncertainty),
            ("Replacement", view.replacement),
            ("Effect", view.effect),
            ("Path", view.note),
        ):
            if value:
                write_wrapped(context, self.layout, f"{label}: {value}")


class R2SEGO_PT_generation_pictures(Sidebar, bpy.types.Panel):
    """The view's clip, its camera's way and its pictures side by side"""

    bl_idname = "R2SEGO_PT_generation_pictures"
    bl_label = "Pictures"
    bl_parent_id = "R2SEGO_PT_generation"
    bl_order = 1

    @classmethod
    def poll(cls, context):
        return _active_view(context) is not None

    def draw(self, context):
        layout, group = self.layout, context.scene.r2sego_generation
        view = _active_view(context)
        row = layout.row(align=True)
        play = row.row(align=True)
        play.enabled = view.has_clip
        play.operator("r2sego.play_clip", text="Clip", icon="PLAY").view = view.rank
        row.operator("r2sego.show_camera_path", text="Path", icon="CURVE_DATA").view = view.rank
        compare = layout.operator("r2sego.compare_view", icon="IMAGE_REFERENCE")
        compare.view, compare.parts = view.rank, group.parts
        conditions = layout.operator("r2sego.compare_view", text="Stored Conditions", icon="TEXTURE")
        conditions.view, conditions.parts = view.rank, _CONDITIONS
        layout.operator("r2sego.render_conditions", icon="RENDER_ANIMATION").view = view.rank
        layout.operator_menu_enum("r2sego.render_target_views", "when", icon="RENDER_STILL")
        layout.grid_flow(columns=2, align=True).prop(group, "parts")
        layout.prop(group, "truth", text="Truth")


def _active_view(context):
    group = context.scene.r2sego_generation
    return group.views[group.active] if 0 <= group.active < len(group.views) else None


CLASSES = (R2SEGO_UL_generated_views, R2SEGO_PT_generation, R2SEGO_PT_generation_view, R2SEGO_PT_generation_pictures)

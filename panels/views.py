"""The sub-panel Views: candidates, the active one and why, the scores over time."""

import bpy

from .fact_list import FactList, fact_list
from .overlays import score_curves, score_curves_click
from .sidebar import Sidebar, Step, write_wrapped


class R2SEGO_UL_ranked_views(FactList, bpy.types.UIList):
    """The target views, best first, then those that may stand in for them"""

    group, facts = "r2sego_views", "ranked"

    def draw_fact(self, layout, group, item, index):
        split = layout.split(factor=0.72, align=True)
        split.active = item.chosen
        icon = "OUTLINER_OB_CAMERA" if item.chosen else "DOT"
        split.label(text=f"{index + 1}   {item.name}", icon=icon)
        split.label(text=f"{item.score:.3f}")


class R2SEGO_PT_views(Step, bpy.types.Panel):
    """Candidate and target views of a round"""

    bl_idname = "R2SEGO_PT_views"
    bl_label = "Views"
    bl_order = 4
    section = "views"

    def draw(self, context):
        self.draw_facts(context)
        layout, group = self.layout, context.scene.r2sego_views
        row = layout.row(align=True)
        row.prop(context.scene.r2sego, "round_index")
        show = row.operator("r2sego.show_candidates", text="Show", icon="OUTLINER_OB_CAMERA")
        show.colour_by, show.shown, show.frustum_size = group.colour_by, group.shown, group.frustum_size
        scores = group.scores
        if scores is None:
            layout.operator("r2sego.look_through", icon="VIEW_CAMERA")
            return
        column = layout.column(align=True)
        column.row(align=True).prop(group, "colour_by", expand=True)
        column.row(align=True).prop(group, "shown", expand=True)
        column.prop(group, "frustum_size")
        best, count = scores.best[group.colour_by], len(scores)
        legend = f"Dark blue 0, yellow {best:.3g}; {scores.survivors} of {count} survive suppression"
        write_wrapped(context, layout, legend)
        if scores.note:
            write_wrapped(context, layout, scores.note, "INFO")
        for number, photograph in enumerate(scores.selection.photographs):
            row = layout.row(align=True)
            x, y, _ = photograph.camera.centre
            row.label(text=f"To take: x {x:.1f}, y {y:.1f} m, {photograph.yaw_deg:.0f}°", icon="CAMERA_DATA")
            row.operator("r2sego.look_through_photograph", text="", icon="VIEW_CAMERA").photograph = number
        fact_list(layout, R2SEGO_UL_ranked_views, group, "ranked_index", rows=4, maxrows=12)


class R2SEGO_PT_views_candidate(Sidebar, bpy.types.Panel):
    """The active candidate view: its scores, and why it is a target or none"""

    bl_idname = "R2SEGO_PT_views_candidate"
    bl_label = "Active Candidate"
    bl_parent_id = "R2SEGO_PT_views"
    bl_order = 0

    @classmethod
    def poll(cls, context):
        return context.scene.r2sego_views.candidates > 0

    def draw(self, context):
        layout, group = self.layout, context.scene.r2sego_views
        row = layout.row(align=True)
        if group.active >= 0:
            row.prop(group, "active")
        else:  # whose field would show -1
            row.label(text="None chosen yet")
        row.operator("r2sego.pick_candidate", text="", icon="EYEDROPPER")
        row = layout.row(align=True)
        row.operator("r2sego.look_through_candidate", text="Look Through", icon="VIEW_CAMERA")
        row.prop(group, "set_frame", text="", icon="TIME")
        if group.active >= 0:
            layout.label(text=f"Frame {group.active_frame} of rollout {group.active_rollout}")
            layout.label(text=group.figures)
            write_wrapped(context, layout, group.why)


class R2SEGO_PT_views_curves(Sidebar, bpy.types.Panel):
    """The scores of a rollout's frames, drawn at the bottom of the 3D view"""

    bl_idname = "R2SEGO_PT_views_curves"
    bl_label = "Scores over Time"
    bl_parent_id = "R2SEGO_PT_views"
    bl_order = 1
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return context.scene.r2sego_views.candidates > 0

    def draw_header(self, context):
        self.layout.prop(context.scene.r2sego_views, "curves", text="")

    def draw(self, context):
        layout, group = self.layout, context.scene.r2sego_views
        layout.active = group.curves
        layout.prop(group, "rollout")
        if group.origin:
            write_wrapped(context, layout, group.origin)


CLASSES = (
    R2SEGO_UL_ranked_views,
    R2SEGO_PT_views,
    R2SEGO_PT_views_candidate,
    R2SEGO_PT_views_curves,
    *score_curves_click.CLASSES,
)


def register() -> None:
    """Start drawing the curves."""
    score_curves.register()


def unregister() -> None:
    """Stop drawing them."""
    score_curves.unregister()

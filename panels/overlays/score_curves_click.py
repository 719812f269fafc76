"""A click in the curves makes the frame's candidate the active one; dragging goes along them."""

import bpy

from .score_curves import shown_chart

_SLACK_PX = 4.0


class R2SEGO_GT_score_curves(bpy.types.Gizmo):
    """The curves' rectangle; it draws nothing itself"""

    bl_idname = "R2SEGO_GT_score_curves"
    __slots__ = ("before",)  # the active candidate when the button went down

    def draw(self, context):
        """The overlay draws the curves."""

    def test_select(self, context, location):
        chart = shown_chart(context)
        return 0 if chart is not None and chart.contains(*location, _SLACK_PX) else -1

    def invoke(self, context, event):
        self.before = context.scene.r2sego_views.active
        _pick(context, event.mouse_region_x)
        return {"RUNNING_MODAL"}

    def modal(self, context, event, tweak):
        _pick(context, event.mouse_region_x)
        return {"RUNNING_MODAL"}

    def exit(self, context, cancel):
        """What was picked stays, as one step to undo: Blender makes none for a gizmo, and an undo over
        the mark, an object that is in no step of its history, crashes it."""
        if context.scene.r2sego_views.active != self.before:
            bpy.ops.ed.undo_push(message="Pick Candidate")


class R2SEGO_GGT_score_curves(bpy.types.GizmoGroup):
    """Clicks in the curves"""

    bl_idname = "R2SEGO_GGT_score_curves"
    bl_label = "Scores over Time"
    bl_space_type, bl_region_type = "VIEW_3D", "WINDOW"
    bl_options = {"PERSISTENT"}

    @classmethod
    def poll(cls, context):
        group = context.scene.r2sego_views
        return group.curves and group.candidates > 0

    def setup(self, context):
        self.gizmos.new(R2SEGO_GT_score_curves.bl_idname)


def _pick(context, x):
    group, scores = context.scene.r2sego_views, context.scene.r2sego_views.scores
    chart = shown_chart(context)
    if scores is None or chart is None:
        return
    candidate = scores.nearest(group.rollout, chart.frame_at(x))
    if candidate >= 0 and candidate != group.active:
        bpy.ops.r2sego.pick_candidate("EXEC_DEFAULT", candidate=candidate)


CLASSES = (R2SEGO_GT_score_curves, R2SEGO_GGT_score_curves)

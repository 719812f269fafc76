"""Make a candidate view the active one: by number, by a click, or by the face chosen in Edit Mode."""

import bpy
from bpy.props import IntProperty
from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d

from ...r2sego_blender.bridge.shared.scope_rays import is_over
from ...r2sego_blender.bridge.views.show_candidates import candidate_of_selection, candidate_on_ray, shown_candidates
from ...r2sego_blender.core.errors import SceneError
from ...r2sego_blender.results.panels.view_chart import chart_in, covered_margins
from ..base import ReportingOperator
from ..view_tool import ViewTool
from .polls import needs_candidates

_SLACK_PX = 6.0


class R2SEGO_OT_pick_candidate(ViewTool, ReportingOperator, bpy.types.Operator):
    """Click a candidate's frustum, or a frame in the curves, to see why it was chosen or not"""

    bl_idname = "r2sego.pick_candidate"
    bl_label = "Pick Candidate"
    bl_options = {"REGISTER", "UNDO"}

    candidate: IntProperty(
        name="Candidate",
        default=-1,
        min=-1,
        description="The candidate's number; -1 takes the one of the face chosen in Edit Mode",
        options={"SKIP_SAVE"},
    )

    hint = "Click a frustum, or the curves at the bottom (drag to go along them); ESC ends"
    cursor = "EYEDROPPER"
    _dragging = False

    @classmethod
    def poll(cls, context):
        return needs_candidates(cls, context)

    def perform(self, context):
        scene = context.scene
        group, scores = scene.r2sego_views, scene.r2sego_views.scores
        if scores is None:
            raise SceneError("the candidates are not read yet", cure="Press Refresh.")
        candidate = self.candidate
        if candidate < 0:
            swarm = shown_candidates(scene, scores.bundle_path)
            candidate = -1 if swarm is None else candidate_of_selection(swarm)
        if candidate < 0:
            raise SceneError(
                "no candidate is named", cure="Give its number, or choose a face of the frusta in Edit Mode."
            )
        if candidate >= len(scores):
            raise SceneError(f"there is no candidate {candidate}", cure=f"The round has 0 to {len(scores) - 1}.")
        group.active = candidate
        if group.set_frame:
            scene.frame_set(group.active_frame)
        return group.why

    def invoke(self, context, event):
        if self.properties.is_property_set("candidate") or context.area is None:
            return self.execute(context)
        if context.area.type != "VIEW_3D":
            return self.execute(context)
        return self.start_tool(context)

    def in_midst(self):
        return self._dragging

    def on_event(self, context, event):
        if event.type in {"ESC", "RIGHTMOUSE"} and event.value == "PRESS":
            return {"FINISHED" if self.changed else "CANCELLED"}
        if self._dragging:
            if event.type == "MOUSEMOVE":
                self._pick(context, self._on_curves(context, event, outside=True))
            if event.type == "LEFTMOUSE" and event.value == "RELEASE":
                return {"FINISHED"}
            return {"RUNNING_MODAL"}
        if event.type != "LEFTMOUSE" or event.value != "PRESS" or not is_over(context.region, event):
            return {"PASS_THROUGH"}
        found = self._on_curves(context, event)
        self._dragging = found >= 0
        if not self._dragging:
            found = self._on_frusta(context, event)
        if found < 0:
            self.report({"INFO"}, "No candidate is there; ESC ends")
            return {"RUNNING_MODAL"}
        self._pick(context, found)
        return {"RUNNING_MODAL" if self._dragging else "FINISHED"}

    def _pick(self, context, candidate):
        if candidate >= 0 and candidate != context.scene.r2sego_views.active:
            self.candidate = candidate
            self.changed |= self.execute(context) == {"FINISHED"}

    def _on_curves(self, context, event, outside=False):
        """The candidate of the frame under the mouse, -1 when the curves are not there."""
        group, scores = context.scene.r2sego_views, context.scene.r2sego_views.scores
        if scores is None or not group.curves:
            return -1
        region = context.region
        frames = scores.selection.frame[scores.of_rollout(group.rollout)]
        others = [other for other in context.area.regions if other.type != "WINDOW"]
        chart = chart_in(
            (region.width, region.height), covered_margins(region, others), context.preferences.system.ui_scale, frames
        )
        x, y = event.mouse_x - region.x, event.mouse_y - region.y
        if chart is None or not (outside or chart.contains(x, y, _SLACK_PX)):
            return -1
        return scores.nearest(group.rollout, chart.frame_at(x))

    def _on_frusta(self, context, event):
        """The candidate whose frustum is under the mouse, -1 when none is."""
        scores, region = context.scene.r2sego_views.scores, context.region
        swarm = None if scores is None else shown_candidates(context.scene, scores.bundle_path)
        if swarm is None or not swarm.visible_get(viewport=context.space_data):
            return -1
        place = (event.mouse_x - region.x, event.mouse_y - region.y)
        view = context.region_data
        origin = region_2d_to_origin_3d(region, view, place)
        return candidate_on_ray(swarm, origin, region_2d_to_vector_3d(region, view, place))

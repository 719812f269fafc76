"""Look through a candidate view."""

import bpy
from bpy.props import IntProperty

from ...r2sego_blender.bridge.views.show_candidates import candidate_camera
from ...r2sego_blender.core.errors import SceneError
from ..base import ReportingOperator
from ..captures.look_through import look_through
from .polls import needs_candidates


class R2SEGO_OT_look_through_candidate(ReportingOperator, bpy.types.Operator):
    """Look through the robot's eye at the active candidate, with its exact lens and image size"""

    bl_idname = "r2sego.look_through_candidate"
    bl_label = "Look Through Candidate"
    bl_options = {"REGISTER", "UNDO"}

    candidate: IntProperty(
        name="Candidate",
        description="The candidate's number; -1 takes the active one",
        default=-1,
        min=-1,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context):
        return needs_candidates(cls, context)

    def perform(self, context):
        scene = context.scene
        scores = scene.r2sego_views.scores
        chosen = scene.r2sego_views.active if self.candidate < 0 else self.candidate
        if scores is None or not 0 <= chosen < len(scores):
            raise SceneError("no candidate is chosen", cure="Pick one in the view or in the list first.")
        camera = candidate_camera(scene, scores.bundle_path, scores.views, chosen)
        look_through(context, camera)
        told = scores.selection
        return f"Candidate {chosen}: rollout {told.rollout[chosen]}, frame {told.frame[chosen]}"

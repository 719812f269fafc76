"""Look through a photograph that had better be taken."""

import bpy
from bpy.props import IntProperty

from ...r2sego_blender.bridge.views.show_candidates import photograph_camera
from ...r2sego_blender.core.errors import SceneError
from .. import state
from ..base import ReportingOperator
from ..captures.look_through import look_through
from . import display
from .polls import needs_candidates


class R2SEGO_OT_look_through_photograph(ReportingOperator, bpy.types.Operator):
    """Show where to stand for a photograph of what the captures lack, and what it would show"""

    bl_idname = "r2sego.look_through_photograph"
    bl_label = "Photograph to Take"
    bl_options = {"REGISTER", "UNDO"}

    photograph: IntProperty(name="Photograph", description="Which of them, the best is 0", default=0, min=0)

    @classmethod
    def poll(cls, context):
        return needs_candidates(cls, context)

    def perform(self, context):
        scene = context.scene
        scores = scene.r2sego_views.scores
        photographs = () if scores is None else scores.selection.photographs
        if self.photograph >= len(photographs):
            raise SceneError(
                "there is no such photograph to take",
                cure="Choose one that the panel lists; where the targets lack nothing there is none.",
            )
        display.show(scene, state.opened_bundle(context))
        look_through(context, photograph_camera(scene, scores.bundle_path, self.photograph))
        return f"Photograph {self.photograph + 1} to take: {photographs[self.photograph].in_words()}"

"""Jump to where an attempt failed."""

import bpy

from ...r2sego_blender.bridge.robot.show_robot import are_shown, show_rollouts
from ...r2sego_blender.core.errors import SceneError
from ...r2sego_blender.results.panels.rollout_list import attempts
from .showing import ShowingOperator


class R2SEGO_OT_jump_to_attempt(ShowingOperator, bpy.types.Operator):
    """Show the attempt and go to the frame where it failed, or to its end"""

    bl_idname = "r2sego.jump_to_attempt"
    bl_label = "Jump to Attempt"
    bl_options = {"REGISTER", "UNDO"}

    def show(self, context, bundle, round_index):
        scene = context.scene
        listed = attempts(bundle, round_index)
        if self.attempt >= len(listed):
            raise SceneError(f"there is no attempt {self.attempt}", where=bundle.path, cure="Choose one of the list.")
        attempt = listed[self.attempt]
        if not attempt.frames:
            scene.r2sego_robot.attempt_index = self.attempt
            return f"Attempt {attempt.number} never began: {attempt.outcome}"
        if not are_shown(scene, bundle, round_index, [attempt.number]):
            show_rollouts(scene, bundle, round_index, [attempt.number])
        scene.frame_set(attempt.frame)
        scene.r2sego_robot.attempt_index = self.attempt
        return f"Attempt {attempt.number}, frame {attempt.frame}: {attempt.outcome}"

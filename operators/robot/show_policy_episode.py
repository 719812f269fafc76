"""Show an episode of a policy on the timeline."""

from functools import partial

import bpy
from bpy.props import BoolProperty, IntProperty

from ...r2sego_blender.bridge.robot.show_policy_episode import show_policy_episode
from ...r2sego_blender.bridge.shared.clip_images import play_in_editor
from ...r2sego_blender.bridge.shared.image_editors import show_image
from .. import state
from ..base import ReportingOperator
from .polls import needs_evaluation


class R2SEGO_OT_show_policy_episode(ReportingOperator, bpy.types.Operator):
    """Show the robot along an episode of the policy, and what its head saw, where that was kept"""

    bl_idname = "r2sego.show_policy_episode"
    bl_label = "Show Policy Episode"
    bl_options = {"REGISTER", "UNDO"}

    episode: IntProperty(name="Episode", description="The episode's number, from 0", default=0, min=0)
    look_through: BoolProperty(
        name="Look Through", description="Make the head camera the scene's camera", default=False
    )
    in_editor: BoolProperty(
        name="In an Image Editor",
        description="Show what the head saw in an Image Editor, a new window if needed",
        options={"SKIP_SAVE"},  # Head sets it, and no other button does
    )

    @classmethod
    def poll(cls, context):
        return needs_evaluation(cls, context)

    def perform(self, context):
        scene, bundle = context.scene, state.opened_bundle(context)
        image = show_policy_episode(scene, bundle, self.episode, look_through=self.look_through)
        scene.r2sego_robot.episode_index = self.episode
        scene.frame_set(0)
        if image is None:
            return f"Episode {self.episode}; what the head saw was not kept"
        frames = scene.r2sego_robot.episodes[self.episode].frames
        if self.in_editor:
            show_image(image, partial(play_in_editor, frames=frames, first_frame=0))
        return f"Episode {self.episode}: {frames} frames"

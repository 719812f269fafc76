"""Show rollouts on the timeline."""

import bpy
from bpy.props import BoolProperty

from ...r2sego_blender.bridge.robot.show_robot import show_rollouts
from ...r2sego_blender.core.errors import SceneError
from ...r2sego_blender.results.panels.rollout_list import attempts
from .showing import ShowingOperator


class R2SEGO_OT_show_rollout(ShowingOperator, bpy.types.Operator):
    """Show the robot along a rollout: its bodies and its head camera follow the timeline"""

    bl_idname = "r2sego.show_rollout"
    bl_label = "Show Rollout"
    bl_options = {"REGISTER", "UNDO"}

    every: BoolProperty(
        name="All Successful", description="Every attempt that succeeded, in place of one", default=False
    )
    look_through: BoolProperty(
        name="Look Through", description="Make the head camera the scene's camera", default=False
    )

    def show(self, context, bundle, round_index):
        chosen = [
            one for one in attempts(bundle, round_index) if (one.success if self.every else one.number == self.attempt)
        ]
        numbers = [one.number for one in chosen] or [self.attempt]
        if self.every and not chosen:
            raise SceneError("no attempt succeeded", where=bundle.path, cure="Look at the failures.")
        show_rollouts(context.scene, bundle, round_index, numbers, look_through=self.look_through)
        return f"Rollout {', '.join(map(str, numbers))}: {max(one.frames for one in chosen)} frames"

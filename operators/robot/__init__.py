"""The robot, its behaviour and its rollouts."""

import bpy

from ...r2sego_blender.bridge.robot import robot_playback
from .. import state
from . import facts
from .choose_robot import R2SEGO_OT_choose_robot
from .choose_scope import R2SEGO_OT_choose_scope
from .draw_region import R2SEGO_OT_draw_region
from .inspect_robot import R2SEGO_OT_inspect_robot
from .jump_to_attempt import R2SEGO_OT_jump_to_attempt
from .pick_target import R2SEGO_OT_pick_target
from .properties import R2SEGO_PG_robot
from .region_from_object import R2SEGO_OT_clear_region, R2SEGO_OT_region_from_object
from .run_rollouts import R2SEGO_OT_run_rollouts
from .set_behaviours import R2SEGO_OT_set_behaviours
from .set_clearance import R2SEGO_OT_set_clearance
from .set_mount import R2SEGO_OT_set_mount
from .show_rollout import R2SEGO_OT_show_rollout
from .try_rollouts import R2SEGO_OT_try_rollouts

CLASSES = (
    R2SEGO_PG_robot,
    R2SEGO_OT_choose_robot,
    R2SEGO_OT_choose_scope,
    R2SEGO_OT_set_behaviours,
    R2SEGO_OT_set_mount,
    R2SEGO_OT_inspect_robot,
    R2SEGO_OT_draw_region,
    R2SEGO_OT_region_from_object,
    R2SEGO_OT_clear_region,
    R2SEGO_OT_set_clearance,
    R2SEGO_OT_pick_target,
    R2SEGO_OT_try_rollouts,
    R2SEGO_OT_run_rollouts,
    R2SEGO_OT_show_rollout,
    R2SEGO_OT_jump_to_attempt,
)


def register() -> None:
    """Attach the room's properties; shown rollouts follow the timeline from now on."""
    bpy.types.Scene.r2sego_robot = bpy.props.PointerProperty(type=R2SEGO_PG_robot)
    state.readers[facts.ScopeFacts] = state.Reader(facts.read_scope)
    state.readers[facts.AttemptFacts] = state.Reader(facts.read_attempts, facts.chosen_attempts)
    robot_playback.register()


def unregister() -> None:
    """Take them away again."""
    robot_playback.unregister()
    del state.readers[facts.AttemptFacts], state.readers[facts.ScopeFacts]
    del bpy.types.Scene.r2sego_robot

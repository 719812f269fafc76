"""The room Robot: the robot, where it may be and what it may do, its rollouts, and a policy's episodes.

Begin with ``facts.py`` (scope, seats, attempts), ``declaring.py`` (operators that change the declaration) and
``showing.py`` (those that show rollouts). May use ``bridge/robot`` and the library, no other room.
"""

import bpy

from ...r2sego_blender.bridge.robot import robot_playback
from .. import state
from . import facts
from .properties import R2SEGO_PG_robot


def register() -> None:
    """Attach the room's properties; shown rollouts follow the timeline from now on."""
    bpy.types.Scene.r2sego_robot = bpy.props.PointerProperty(type=R2SEGO_PG_robot)
    state.readers[facts.ScopeFacts] = state.Reader(facts.read_scope)
    state.readers[facts.AttemptFacts] = state.Reader(facts.read_attempts, facts.chosen_attempts)
    state.readers[facts.PolicyFacts] = state.Reader(facts.read_policy)
    robot_playback.register()


def unregister() -> None:
    """Take them away again."""
    robot_playback.unregister()
    del state.readers[facts.PolicyFacts], state.readers[facts.AttemptFacts], state.readers[facts.ScopeFacts]
    del bpy.types.Scene.r2sego_robot

"""Controllers that learned policies drive, in scopes of chosen behaviours."""

from __future__ import annotations

from dataclasses import replace

from r2sego_blender.config.settings import RolloutSettings
from r2sego_blender.robot.controllers.policy import PolicyController
from r2sego_blender.robot.planning.free_floor import free_floor
from r2sego_blender.robot.scope.scope import Behaviours, BehaviourScope, Control

SCOPE = BehaviourScope.load("walk_and_look")


def controller(robot, scene, file, layout, scope=SCOPE) -> PolicyController:
    """The policy ``file`` with its ``layout`` on ``robot``, in the room of ``scene``."""
    control = Control(kind="policy", file=str(file), layout=str(layout))
    scope = replace(scope, controller=control)
    return PolicyController(robot, free_floor(robot, scope, scene), scope, scene, RolloutSettings())


def only(scope: BehaviourScope, **weights: float) -> BehaviourScope:
    """The scope with these behaviours, in place of walking and looking around."""
    return replace(scope, behaviours=Behaviours(**({"walk_to": 0.0, "look_around": 0.0} | weights)))

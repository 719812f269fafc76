"""The behaviour controller mu_B: what draws attempts at the declared behaviour and drives them."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import mujoco
import numpy as np

from ...config.settings import RolloutSettings
from ..behaviours.trajectory import Seat
from ..model.composition import Composition
from ..model.model import RobotModel
from ..model.mount import CameraMount
from ..planning.course import require_legs
from ..planning.free_floor import FreeFloor
from ..scope.scope import BehaviourScope
from .seeing_policy import Sight


class Drive(Protocol):
    """One attempt: where it starts, and its controls step by step.

    ``qpos`` (nq,) float64 is the start, in the composition's coordinates; ``goal`` (2,)
    where the base has to end, None for anywhere; ``seat`` what it sits on; ``mount`` the
    camera of this attempt. ``duration_s`` is when it ends; it may come nearer as the attempt goes on.
    """

    behaviour: str
    qpos: np.ndarray
    duration_s: float
    goal: np.ndarray | None
    seat: Seat | None
    mount: CameraMount

    def apply(self, data: mujoco.MjData, step: int) -> None:
        """Write the controls of simulation step ``step`` into ``data``."""


class Controller(Protocol):
    """Draws attempts in one scene; ``name`` is shown with every result."""

    name: str
    composition: Composition

    def draw(self, rng: np.random.Generator) -> Drive | None:
        """An attempt drawn from the scope; None where the floor offers no goal."""


def make_controller(
    robot: RobotModel,
    floor: FreeFloor,
    scope: BehaviourScope,
    collision_mjcf: Path,
    settings: RolloutSettings,
    sight: Sight | None = None,
) -> Controller:
    """The controller that ``scope`` names; ``sight`` is what a student sees. Raises RobotError: files it cannot use."""
    if scope.controller.kind == "policy":
        from .policy import PolicyController

        return PolicyController(robot, floor, scope, collision_mjcf, settings)
    if scope.controller.kind == "replay":
        from .replay import ReplayController

        return ReplayController(robot, floor, scope, collision_mjcf, settings)
    if scope.controller.kind == "student":
        from .student import StudentController

        return StudentController(robot, floor, scope, collision_mjcf, settings, sight)
    from .tracking import TrackingController

    return TrackingController(robot, floor, scope, collision_mjcf, settings)


def check_controller(robot: RobotModel, scope: BehaviourScope) -> None:
    """Refuse, before there is a surface to stand on, what no rollout of ``robot`` could do.

    Policies and motions are read and tried as ``make_controller`` does. Raises RobotError.
    """
    require_legs(robot, scope)
    if scope.controller.tracker and scope.controller.kind in ("reference", "replay"):
        from .twist2 import Twist2

        Twist2(scope.controller.tracker, robot)
    if scope.controller.kind == "policy":
        from .policy import DeclaredPolicy

        DeclaredPolicy.load(robot, scope)
    elif scope.controller.kind == "student":
        from .student import DeclaredStudent

        DeclaredStudent.load(robot, scope)
    elif scope.controller.kind == "replay":
        from .replay import DeclaredMotions

        DeclaredMotions.load(robot, scope)

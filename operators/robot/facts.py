"""What the sub-panel Robot knows: the scope, the seats, the attempts of the round or the trial, and a policy's."""

from collections.abc import Hashable
from dataclasses import dataclass

import bpy

from ...r2sego_blender.bridge.shared.panel_facts import Facts
from ...r2sego_blender.core.errors import R2SEgoError
from ...r2sego_blender.results.panels.bundle import Bundle
from ...r2sego_blender.results.panels.robot_facts import RobotFacts
from ...r2sego_blender.results.panels.rollout_list import POLICY, TRIAL, attempts, has_rollouts
from ...r2sego_blender.results.policy_evaluation import POLICY_EVALUATION, PolicyEvaluation, is_recorded
from ...r2sego_blender.robot.scope.region import format_polygon
from ..state import Line


@dataclass(frozen=True)
class ScopeFacts:
    """The behaviour region as a text, '' for the free floor, the seats, and what is told of the robot."""

    region: str = ""
    seats: Facts = Facts()
    lines: tuple[Line, ...] = ()
    problem: str = ""


@dataclass(frozen=True)
class AttemptFacts:
    """The attempts that are listed."""

    attempts: Facts = Facts()
    succeeded: int = 0
    problem: str = ""


@dataclass(frozen=True)
class PolicyFacts:
    """The recorded evaluation of a policy, None where there is none, and its episodes."""

    evaluation: PolicyEvaluation | None = None
    episodes: Facts = Facts()
    problem: str = ""


def read_scope(_scene: bpy.types.Scene, bundle: Bundle) -> ScopeFacts:
    """The declared scope and robot. What cannot be read is the room's own problem."""
    try:
        known = RobotFacts.read(bundle)
        lines = tuple(Line("robot", label, value) for label, value in known.lines())
        return ScopeFacts(format_polygon(known.region), Facts(known.seats), lines)
    except R2SEgoError as error:
        return ScopeFacts(problem=str(error))


def read_attempts(scene: bpy.types.Scene, bundle: Bundle) -> AttemptFacts:
    """The attempts of the source that is chosen. What cannot be read is the room's own problem."""
    index = round_of(scene, scene.r2sego_robot.source == "TRIAL")
    try:
        found = Facts(attempts(bundle, index) if has_rollouts(bundle, index) else ())
    except R2SEgoError as error:
        return AttemptFacts(problem=str(error))
    return AttemptFacts(found, sum(one.success for one in found))


def read_policy(_scene: bpy.types.Scene, bundle: Bundle) -> PolicyFacts:
    """The recorded evaluation. What cannot be read, or does not fit together, is the room's own problem."""
    if not is_recorded(bundle):
        return PolicyFacts()
    try:
        evaluation = bundle.read(POLICY_EVALUATION)
        found = attempts(bundle, POLICY)
        evaluation.require_of(one.reason for one in found)
        return PolicyFacts(evaluation, Facts(found))
    except R2SEgoError as error:
        return PolicyFacts(problem=str(error))


def chosen_attempts(scene: bpy.types.Scene) -> Hashable:
    """Which attempts are listed."""
    return scene.r2sego_robot.source, scene.r2sego.round_index


def round_of(scene: bpy.types.Scene, trial: bool, round_index: int = -1) -> int:
    """The round to show: TRIAL, the one named, or where that is negative the one shown."""
    if trial:
        return TRIAL
    return scene.r2sego.round_index if round_index < 0 else round_index

"""What rollouts take for granted of a robot's and a motion's file, said before they begin."""

from __future__ import annotations

from collections.abc import Sequence

from ...core.progress import Progress
from ..model.model import RobotModel
from ..motion.motion_facts import motion_facts, motion_line
from ..scope.scope import BehaviourScope

_NAMED = 3


def bounded_links_line(links: Sequence[str]) -> str:
    """Which links' masses or inertias are not the file's, for a person; '' where all are."""
    more = f" and {len(links) - _NAMED} more" if len(links) > _NAMED else ""
    named = f"the file's inertias of {', '.join(links[:_NAMED])}{more} are no body's"
    return f"{named}: balanced, with 1 g and 1e-5 kg m2 at least" if links else ""


def tell_assumptions(robot: RobotModel, scope: BehaviourScope, progress: Progress) -> None:
    """Tell bounded inertias, and each motion's rate and length; as a warning where the rate is assumed.

    Raises RobotError where a motion cannot be read.
    """
    if line := bounded_links_line(robot.bounded_links):
        progress.message(line, "warning")
    for path in scope.controller.motions if scope.controller.kind == "replay" else ():
        facts = motion_facts(path)
        progress.message(motion_line(facts), "info" if facts["rate_field"] else "warning")

"""Rollouts of the declared behaviour: simulated, judged, resampled until enough succeed."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from pathlib import Path

from ...config.settings import RolloutSettings
from ...core.errors import RobotError
from ...core.progress import SILENT, Progress
from ..controllers.seeing_policy import Sight
from ..model.model import RobotModel
from ..model.mujoco_warnings import described
from ..planning.free_floor import free_floor
from ..scope.scope import BehaviourScope
from .assumptions import tell_assumptions
from .attempts import Attempts, in_order
from .failures import Reason
from .rollout import Rollout, failed_by_reason

_CURES = {
    Reason.NO_GOAL: "Give the behaviour scope shorter walk_to.distance_m, or a larger region.",
    Reason.BODY_CONTACT: "Check the collision surface, or give a larger region.clearance_m (`r2sego robot "
    "--set`, in Blender Clearance under Behaviour Region).",
    Reason.LEFT_REGION: "Give the behaviour scope a larger region.",
    Reason.TIME_OUT: "Give a longer episode.duration_s or shorter walks.",
    Reason.MISSED_TARGET: "Check the seat on the collision surface, or give other sit_on ranges.",
    Reason.FALL: "Check the floor of the collision surface and the tracking bounds.",
    Reason.JOINT_LIMIT: "Give narrower look ranges, or a higher start.pelvis_height.",
    Reason.FOOT_SLIDE: "Give slower walks, or a larger failures.slide_m.",
    Reason.PENETRATION: "Check the collision surface, or give a larger failures.penetration_m.",
    Reason.NON_FINITE: "Check the collision surface, or give a smaller rollouts.step_s.",
}
_UNPLACED_CURE = (
    "Give a shorter episode.duration_s, of which a shorter part is drawn, other motions, or a larger region."
)


def successful_rollouts(
    model: RobotModel,
    scope: BehaviourScope,
    collision_mjcf: Path,
    settings: RolloutSettings,
    seed: int,
    progress: Progress = SILENT,
    sight: Sight | None = None,
) -> tuple[Rollout, ...]:
    """Roll the behaviour out until ``settings.successes`` have succeeded (Sec. III-B.2).

    Returns every attempt in order, failures included; the last one is a success. The same
    arguments give the same bits, in however many processes; ``sight`` is what a student sees. Raises RobotError when
    ``settings.max_attempts`` have not sufficed, naming the most frequent reason; or where
    the scene has no free floor.
    """
    attempts: list[Rollout] = []
    tell_assumptions(model, scope, progress)
    floor = free_floor(model, scope, collision_mjcf)
    tried = in_order(Attempts(model.source, model.mount, scope, floor, collision_mjcf, settings, seed, sight))
    with progress.task("Rollouts", settings.successes) as task:
        for rollout in tried:
            attempts.append(rollout)
            task.advance(int(rollout.success))
            if task.done == settings.successes or len(attempts) == settings.max_attempts:
                break
    tried.close()
    tell_warnings(attempts, progress)
    if task.done < settings.successes:
        raise _too_few(attempts, task.done, settings, scope, collision_mjcf)
    return tuple(attempts)


def tell_warnings(attempts: Sequence[Rollout], progress: Progress) -> None:
    """Tell the person what MuJoCo warned of in these attempts, if it did, as one warning."""
    warned = [attempt for attempt in attempts if attempt.warnings]
    if warned:
        words = described(chain.from_iterable(attempt.warnings for attempt in warned))
        progress.message(f"MuJoCo warned in {len(warned)} of {len(attempts)} attempts: {words}", "warning")


def _too_few(
    attempts: Sequence[Rollout], successes: int, settings: RolloutSettings, scope: BehaviourScope, collision_mjcf: Path
) -> RobotError:
    reason, failed = next(iter(failed_by_reason(attempts).items()))
    is_unplaced = reason == Reason.NO_GOAL and scope.controller.kind == "replay"
    return RobotError(
        f"only {successes} of {settings.successes} rollouts succeeded in {len(attempts)} attempts; "
        f"{len(failed)} failed by {reason} ({failed[0].detail})",
        where=collision_mjcf,
        cure=_UNPLACED_CURE if is_unplaced else _CURES[Reason(reason)],
    )

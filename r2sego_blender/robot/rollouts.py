"""Rollouts of the declared behaviour: simulated, judged, resampled until enough succeed."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arrays import opened_arrays, save_arrays
from ..errors import RobotError
from ..progress import SILENT, Progress
from ..settings import RolloutSettings
from .composition import compose
from .controller import Reason, Tracker
from .free_floor import free_floor
from .model import RobotModel
from .motion import plan_motion
from .scope import BehaviourScope

_ARRAYS, _REASONS = "rollouts.npz", "rollouts.json"

_CURES = {
    Reason.NO_GOAL: "Give the behaviour scope shorter walk_to.distance_m, or a larger region.",
    Reason.BODY_CONTACT: "Check the collision surface, or give a larger region.clearance_m.",
    Reason.LEFT_REGION: "Give the behaviour scope a larger region.",
    Reason.TIME_OUT: "Give a longer episode.duration_s or shorter walks.",
    Reason.FALL: "Check the floor of the collision surface and the tracking bounds.",
    Reason.JOINT_LIMIT: "Give narrower look ranges, or a higher start.pelvis_height.",
    Reason.NON_FINITE: "Check the collision surface, or give a smaller rollouts.step_s.",
}


@dataclass(frozen=True)
class Rollout:
    """One attempt at the behaviour.

    ``qpos`` (T, nq) float64, ``times_s`` (T,) float64 and ``camera_poses`` (T, 4, 4) float64
    ``world_from_camera`` are at the scope's camera rate. A failed one carries its ``reason``,
    what happened in ``detail``, and ends at ``frame``, the last before the failure.
    ``seed`` is (the round's seed, the attempt): the rollout depends on nothing else.
    """

    success: bool
    reason: str
    frame: int
    qpos: np.ndarray
    times_s: np.ndarray
    camera_poses: np.ndarray
    seed: tuple[int, int]
    behaviour: str = ""
    detail: str = ""


def successful_rollouts(
    model: RobotModel,
    scope: BehaviourScope,
    collision_mjcf: Path,
    settings: RolloutSettings,
    seed: int,
    progress: Progress = SILENT,
) -> tuple[Rollout, ...]:
    """Roll the behaviour out until ``settings.successes`` have succeeded (Sec. III-B.2).

    Returns every attempt in order, failures included; the last one is a success. The same
    arguments give the same bits. Raises RobotError when ``settings.max_attempts`` have not
    sufficed, naming the most frequent reason; or where the scene has no free floor.
    """
    floor = free_floor(model, scope, collision_mjcf)
    composition = compose(model, collision_mjcf, settings)
    tracker = Tracker(composition, floor, scope, model.rest_height_m)
    attempts: list[Rollout] = []
    with progress.task("Rollouts", settings.successes) as task:
        while task.done < settings.successes:
            if len(attempts) == settings.max_attempts:
                raise _too_few(attempts, task.done, settings, collision_mjcf)
            key = (seed, len(attempts))
            motion = plan_motion(model, floor, scope, np.random.default_rng(key))
            if motion is None:
                attempts.append(_without_goal(model, key))
                continue
            tracked = tracker.track(motion)
            attempts.append(
                Rollout(
                    success=not tracked.reason,
                    reason=str(tracked.reason),
                    frame=len(tracked.qpos) - 1,
                    qpos=tracked.qpos,
                    times_s=tracked.times_s,
                    camera_poses=model.camera_poses(tracked.qpos, motion.mount),
                    seed=key,
                    behaviour=motion.behaviour,
                    detail=tracked.detail,
                )
            )
            task.advance(int(attempts[-1].success))
    return tuple(attempts)


def save_rollouts(folder: Path, rollouts: Sequence[Rollout]) -> None:
    """Write ``rollouts.npz`` (the arrays) and ``rollouts.json`` (reasons, for people)."""
    arrays, records = {}, []
    for index, rollout in enumerate(rollouts):
        for name in ("qpos", "times_s", "camera_poses"):
            arrays[f"{name}_{index:04d}"] = getattr(rollout, name)
        records.append(
            {
                "success": rollout.success,
                "reason": rollout.reason,
                "detail": rollout.detail,
                "frame": rollout.frame,
                "frames": len(rollout.qpos),
                "behaviour": rollout.behaviour,
                "seed": list(rollout.seed),
            }
        )
    save_arrays(folder / _ARRAYS, **arrays)
    failures = Counter(rollout.reason for rollout in rollouts if not rollout.success)
    summary = {"attempts": len(rollouts), "failures": dict(failures), "rollouts": records}
    (folder / _REASONS).write_text(json.dumps(summary, indent=1) + "\n")


def load_rollouts(folder: Path) -> tuple[Rollout, ...]:
    """Read what ``save_rollouts`` wrote. Raises RobotError where that is not there whole."""
    with opened_arrays(folder / _ARRAYS, RobotError, "these rollouts cannot be read") as arrays:
        records = json.loads((folder / _REASONS).read_text())["rollouts"]
        return tuple(
            Rollout(
                success=record["success"],
                reason=record["reason"],
                frame=record["frame"],
                qpos=arrays[f"qpos_{index:04d}"],
                times_s=arrays[f"times_s_{index:04d}"],
                camera_poses=arrays[f"camera_poses_{index:04d}"],
                seed=tuple(record["seed"]),
                behaviour=record["behaviour"],
                detail=record["detail"],
            )
            for index, record in enumerate(records)
        )


def _without_goal(model: RobotModel, key: tuple[int, int]) -> Rollout:
    return Rollout(
        success=False, reason=str(Reason.NO_GOAL), frame=0, qpos=np.empty((0, model.model.nq)),
        times_s=np.empty(0), camera_poses=np.empty((0, 4, 4)), seed=key, behaviour="walk_to",
        detail="no reachable place lies in the range of distances",
    )  # fmt: skip


def _too_few(
    attempts: Sequence[Rollout], successes: int, settings: RolloutSettings, collision_mjcf: Path
) -> RobotError:
    failed = [attempt for attempt in attempts if not attempt.success]
    ((reason, count),) = Counter(attempt.reason for attempt in failed).most_common(1)
    example = next(attempt.detail for attempt in failed if attempt.reason == reason)
    return RobotError(
        f"only {successes} of {settings.successes} rollouts succeeded in {len(attempts)} attempts; "
        f"{count} failed by {reason} ({example})",
        where=collision_mjcf, cure=_CURES[Reason(reason)],
    )  # fmt: skip

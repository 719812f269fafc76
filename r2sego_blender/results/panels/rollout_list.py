"""The attempts of a round, of a trial, or of a policy, as Blender lists them. No bpy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...core.errors import SceneError
from ...robot.rollouts.rollout import ROLLOUTS, Rollout
from .bundle import Bundle

TRIAL = -1
"""In place of a round's number: the attempts that were tried without a round."""

POLICY = -2
"""In place of a round's number: the recorded episodes of a policy."""

_APART = {TRIAL: "robot/trial", POLICY: "robot/policy"}
_CURES = {POLICY: "Press Evaluate under Policy again."}
_CURE = "Run Refine, or Try Rollouts, again."


@dataclass(frozen=True)
class Attempt:
    """One attempt at the behaviour; ``frame`` is the last before a failure, or the last of all,
    and ``time_s`` its time. ``reason`` and ``detail`` say why it failed; '' for a success.
    ``assist_n`` is the mean size of the helping force on the base."""

    number: int
    behaviour: str
    success: bool
    reason: str
    detail: str
    frame: int
    frames: int
    time_s: float
    assist_n: float

    @property
    def outcome(self) -> str:
        """What became of it, in words."""
        return "succeeded" if self.success else self.detail or self.reason.replace("_", " ")


def rollouts_folder(bundle: Bundle, round_index: int) -> Path:
    """Where the rollouts of a round, of the last trial, or of a policy, stand."""
    if round_index in _APART:
        return bundle.path / _APART[round_index]
    return bundle.scene.round_folder(round_index) / "rollouts"


def bodies_folder(bundle: Bundle, round_index: int) -> Path:
    """Where the robot's bodies along these rollouts stand, once they are written."""
    if round_index in _APART:
        return rollouts_folder(bundle, round_index)
    return bundle.scene.round_folder(round_index) / "bodies"


def has_rollouts(bundle: Bundle, round_index: int) -> bool:
    """Whether there are any."""
    return (rollouts_folder(bundle, round_index) / "rollouts.json").is_file()


def attempts(bundle: Bundle, round_index: int) -> list[Attempt]:
    """Every attempt in order. Raises SceneError when there are none, RobotError when their files
    are damaged."""
    folder = rollouts_folder(bundle, round_index)
    if not has_rollouts(bundle, round_index):
        what = "nothing was tried yet" if round_index in _APART else f"round {round_index} has no rollouts"
        raise SceneError(what, where=folder, cure=_CURES.get(round_index, _CURE))
    return [
        Attempt(
            number,
            told.behaviour,
            told.success,
            told.reason,
            told.detail,
            told.frame,
            len(told.qpos),
            float(told.times_s[-1]) if len(told.times_s) else 0.0,
            told.quality.assist_n,
        )
        for number, told in enumerate(_rollouts(bundle, round_index))
    ]


def camera_poses(bundle: Bundle, round_index: int, number: int) -> np.ndarray:
    """``world_from_camera`` (T, 4, 4) float64 of the head camera along an attempt."""
    return _rollouts(bundle, round_index)[number].camera_poses


def start_poses(bundle: Bundle, round_index: int) -> np.ndarray:
    """(N, 3) float64: where each attempt's base began, x and y in metres and its heading in radians.

    nan for one that never began, and for camera flights. Raises RobotError where their files are damaged.
    """
    every = [told.qpos for told in _rollouts(bundle, round_index)]
    first = [qpos[0, :7] if len(qpos) and qpos.shape[1] >= 7 else np.full(7, np.nan) for qpos in every]
    x, y, _, w, i, j, k = np.reshape(first, (-1, 7)).T
    return np.stack([x, y, np.arctan2(2.0 * (w * k + i * j), 1.0 - 2.0 * (j * j + k * k))], axis=1)


def _rollouts(bundle: Bundle, round_index: int) -> tuple[Rollout, ...]:
    """Raises RobotError where their files are damaged."""
    apart = _APART.get(round_index)
    return bundle.read(replace(ROLLOUTS, name=apart) if apart else ROLLOUTS.of_round(round_index))

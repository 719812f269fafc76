"""The attempts of a round, or of a trial, as Blender lists them. No bpy."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...core.arrays import opened_arrays
from ...core.errors import SceneError
from .bundle import Bundle

TRIAL = -1
"""In place of a round's number: the attempts that were tried without a round."""

_CURE = "Run Refine, or Try Rollouts, again."


@dataclass(frozen=True)
class Attempt:
    """One attempt at the behaviour; ``frame`` is the last before a failure, or the last of all,
    and ``time_s`` its time. ``reason`` and ``detail`` say why it failed; '' for a success."""

    number: int
    behaviour: str
    success: bool
    reason: str
    detail: str
    frame: int
    frames: int
    time_s: float

    @property
    def outcome(self) -> str:
        """What became of it, in words."""
        return "succeeded" if self.success else self.detail or self.reason.replace("_", " ")


def rollouts_folder(bundle: Bundle, round_index: int) -> Path:
    """Where the rollouts of a round, or of the last trial, stand."""
    if round_index == TRIAL:
        return bundle.path / "robot" / "trial"
    return bundle.scene.round_folder(round_index) / "rollouts"


def bodies_folder(bundle: Bundle, round_index: int) -> Path:
    """Where the robot's bodies along these rollouts stand, once they are written."""
    if round_index == TRIAL:
        return rollouts_folder(bundle, TRIAL)
    return bundle.scene.round_folder(round_index) / "bodies"


def has_rollouts(bundle: Bundle, round_index: int) -> bool:
    """Whether there are any."""
    return (rollouts_folder(bundle, round_index) / "rollouts.json").is_file()


def attempts(bundle: Bundle, round_index: int) -> list[Attempt]:
    """Every attempt in order. Raises SceneError when there are none, or their files are damaged."""
    folder = rollouts_folder(bundle, round_index)
    if not has_rollouts(bundle, round_index):
        what = "nothing was tried yet" if round_index == TRIAL else f"round {round_index} has no rollouts"
        raise SceneError(what, where=folder, cure=_CURE)
    try:
        records = json.loads((folder / "rollouts.json").read_text(encoding="utf-8"))["rollouts"]
        keys = [f"times_s_{index:04d}" for index in range(len(records))]
        with opened_arrays(folder / "rollouts.npz", SceneError, "it cannot be read", _CURE) as arrays:
            times_s = [arrays[key] for key in keys]
        return [
            Attempt(
                index, record["behaviour"], record["success"], record["reason"], record["detail"],
                record["frame"], record["frames"], float(times_s[index][-1]) if len(times_s[index]) else 0.0,
            )
            for index, record in enumerate(records)
        ]  # fmt: skip
    except (OSError, ValueError, KeyError, TypeError) as error:
        what = f"it is damaged: {error!r:.200}"
        raise SceneError(what, where=folder / "rollouts.json", cure=_CURE) from error


def camera_poses(bundle: Bundle, round_index: int, number: int) -> np.ndarray:
    """``world_from_camera`` (T, 4, 4) float64 of the head camera along an attempt."""
    file = rollouts_folder(bundle, round_index) / "rollouts.npz"
    with opened_arrays(file, SceneError, "it cannot be read", _CURE) as arrays:
        return arrays[f"camera_poses_{number:04d}"].astype(np.float64)

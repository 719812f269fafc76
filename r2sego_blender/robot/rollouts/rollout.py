"""Rollouts as they are kept: what became of each attempt, where robot and camera went. NumPy alone."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...bundle.artifacts import Artifact
from ...core.arrays import opened_arrays, require_finite, require_shapes, save_arrays
from ...core.errors import RobotError
from ...core.json_files import opened_json, write_json

ARRAYS, REASONS = "rollouts.npz", "rollouts.json"
_UNIT_WITHIN = 1e-3
_FRAMES = ("qpos", "times_s", "camera_poses")
_TOLD = {"success": bool, "reason": str, "frame": int, "behaviour": str, "detail": str, "controller": str}


@dataclass(frozen=True)
class Quality:
    """What a simulation measured of a rollout.

    ``foot_slide_m``: the farthest a foot moved along the floor while it carried a tenth of
    the weight or more; ``penetration_m``: the deepest the robot sank into the scene;
    ``seated_s``: how long, to the end, a seat carried three tenths of the weight or more;
    ``assist_n``: mean size of the helping force on the base, 0 without one;
    ``camera_height_m`` and ``camera_pitch_deg``: lowest and highest, the pitch below the
    horizon.
    """

    foot_slide_m: float = 0.0
    penetration_m: float = 0.0
    seated_s: float = 0.0
    assist_n: float = 0.0
    camera_height_m: tuple[float, float] = (0.0, 0.0)
    camera_pitch_deg: tuple[float, float] = (0.0, 0.0)

    @staticmethod
    def from_json(values: dict[str, Any]) -> Quality:
        """The quality of its fields as JSON has them. Raises TypeError or ValueError for what is none."""
        fields: dict[str, Any] = {}
        for key, value in values.items():
            if key.startswith("camera_"):
                low, high = map(float, value)
                fields[key] = (low, high)
            else:
                fields[key] = float(value)
            require_finite(**{key: np.array(fields[key])})
        return Quality(**fields)


@dataclass(frozen=True)
class Rollout:
    """One attempt at the behaviour.

    ``qpos`` (T, nq) float64, ``times_s`` (T,) float64 and ``camera_poses`` (T, 4, 4) float64
    ``world_from_camera`` are at the scope's camera rate. A failed one carries its ``reason``,
    what happened in ``detail``, and ends at ``frame``, the last before the failure.
    ``seed`` is (the round's seed, the attempt): the rollout depends on nothing else.
    ``controller`` names what drove it; ``quality`` is what the simulation measured;
    ``warnings`` are MuJoCo's own, in the order they came.
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
    controller: str = ""
    quality: Quality = Quality()
    warnings: tuple[str, ...] = ()


def failed_by_reason(rollouts: Sequence[Rollout]) -> dict[str, list[Rollout]]:
    """The failed ones by their reason, the most frequent first."""
    by_reason: dict[str, list[Rollout]] = {}
    for rollout in rollouts:
        if not rollout.success:
            by_reason.setdefault(rollout.reason, []).append(rollout)
    return dict(sorted(by_reason.items(), key=lambda item: -len(item[1])))


def save_rollouts(folder: Path, rollouts: Sequence[Rollout]) -> None:
    """Write ``rollouts.npz`` (the arrays) and ``rollouts.json`` (reasons, for people)."""
    arrays, records = {}, []
    for index, rollout in enumerate(rollouts):
        for name in _FRAMES:
            arrays[f"{name}_{index:04d}"] = getattr(rollout, name)
        records.append(
            {
                "success": rollout.success,
                "reason": rollout.reason,
                "detail": rollout.detail,
                "frame": rollout.frame,
                "frames": len(rollout.qpos),
                "behaviour": rollout.behaviour,
                "controller": rollout.controller,
                "seed": list(rollout.seed),
                "quality": dataclasses.asdict(rollout.quality),
                "warnings": list(rollout.warnings),
            }
        )
    save_arrays(folder / ARRAYS, **arrays)
    failures = Counter(rollout.reason for rollout in rollouts if not rollout.success)
    summary = {"attempts": len(rollouts), "failures": dict(failures), "rollouts": records}
    write_json(folder / REASONS, summary)


def load_rollouts(folder: Path) -> tuple[Rollout, ...]:
    """Read what ``save_rollouts`` wrote. Raises RobotError where that is not there whole."""
    what = "these rollouts cannot be read"
    with opened_json(folder / REASONS, RobotError, what) as words:
        records: list[dict[str, Any]] = [
            {
                **{name: _of(kind, record[name]) for name, kind in _TOLD.items()},
                "seed": tuple(record["seed"]),
                "quality": Quality.from_json(record["quality"]),
                "warnings": tuple(record.get("warnings", ())),  # bundles of before 2026-11-22 have none
            }
            for record in words["rollouts"]
        ]
    rollouts = []
    with opened_arrays(folder / ARRAYS, RobotError, what) as data:
        for index, record in enumerate(records):
            arrays = {name: data[f"{name}_{index:04d}"] for name in _FRAMES}
            require_shapes(arrays, qpos="T Q", times_s="T", camera_poses="T 4 4")
            _require_sound(**arrays)
            if not 0 <= record["frame"] <= len(arrays["qpos"]):
                raise ValueError(f"rollout {index} ends at frame {record['frame']}")
            rollouts.append(Rollout(**{**record, **arrays}))
    return tuple(rollouts)


def _require_sound(qpos: np.ndarray, times_s: np.ndarray, camera_poses: np.ndarray) -> None:
    """Raises ValueError where numbers are infinite or none, or rotations are none."""
    require_finite(qpos=qpos, times_s=times_s, camera_poses=camera_poses)
    require_rigid(camera_poses=camera_poses)
    if (np.diff(times_s) < 0.0).any():
        raise ValueError("time goes back")
    turns = qpos[:, 3:7]  # of the free base, which stands first; camera flights have none
    if turns.shape[1] == 4 and np.abs(np.linalg.norm(turns, axis=1) - 1.0).max(initial=0.0) > _UNIT_WITHIN:
        raise ValueError("the base's quaternions have not length 1")


def require_rigid(**poses: np.ndarray) -> None:
    """Raises ValueError where poses (..., 4, 4) are more than a turn and a shift."""
    for name, pose in poses.items():
        turn = pose[..., :3, :3]
        is_turn = np.abs(turn @ np.swapaxes(turn, -1, -2) - np.eye(3)).max(initial=0.0) < _UNIT_WITHIN
        last = np.abs(pose[..., 3, :] - [0.0, 0.0, 0.0, 1.0]).max(initial=0.0) < _UNIT_WITHIN
        if not (is_turn and last and (np.linalg.det(turn) > 0.0).all()):
            raise ValueError(f"{name} are not rigid")


def _of(kind: type, value: object) -> Any:
    if not isinstance(value, kind):
        raise TypeError(f"{value!r} is no {kind.__name__}")
    return value


def _save(rollouts: Sequence[Rollout], folder: Path) -> None:
    save_rollouts(folder, rollouts)


ROLLOUTS = Artifact("rollouts", load_rollouts, _save)
"""Every attempt of a round: ``ROLLOUTS.of_round(l)``."""

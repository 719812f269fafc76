"""The candidate stream V_0: every camera pose of the accepted rollouts (Eq. 2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ...core.cameras import Camera
from ..model.model import RobotModel
from .rollout import Rollout


@dataclass(frozen=True)
class Candidates:
    """Candidate views in the order of time.

    ``poses`` (M, 4, 4) float64 ``world_from_camera``; ``rollout`` (M,) int32, the index of
    the accepted rollout, from 0; ``frame`` (M,) int32, the frame in it.
    """

    poses: np.ndarray
    rollout: np.ndarray
    frame: np.ndarray

    def __len__(self) -> int:
        return len(self.poses)


def candidate_stream(rollouts: Sequence[Rollout], max_turn_deg_s: float = 0.0) -> Candidates:
    """The frames of the successful ``rollouts``; failed ones are passed over.

    Frames at which the camera turns faster than ``max_turn_deg_s`` would be blurred and are
    left out; 0 keeps all.
    """
    accepted = [rollout for rollout in rollouts if rollout.success]
    frames = [np.flatnonzero(_is_steady(rollout, max_turn_deg_s)) for rollout in accepted]
    lengths = [len(steady) for steady in frames]
    poses = [rollout.camera_poses[steady] for rollout, steady in zip(accepted, frames, strict=True)]
    return Candidates(
        poses=np.concatenate([np.empty((0, 4, 4)), *poses]),
        rollout=np.repeat(np.arange(len(accepted), dtype=np.int32), lengths),
        frame=np.concatenate([np.empty(0, np.int32), *frames]).astype(np.int32),
    )


def _is_steady(rollout: Rollout, max_turn_deg_s: float) -> np.ndarray:
    """(T,) bool: which frames turn slowly enough, to the one before and the one after."""
    if max_turn_deg_s == 0.0 or len(rollout.times_s) < 2:
        return np.ones(len(rollout.times_s), bool)
    turn = np.swapaxes(rollout.camera_poses[:-1, :3, :3], 1, 2) @ rollout.camera_poses[1:, :3, :3]
    rate_deg_s = np.degrees(Rotation.from_matrix(turn).magnitude()) / np.diff(rollout.times_s)
    fast = rate_deg_s > max_turn_deg_s
    return ~(np.append(fast, False) | np.append(False, fast))


def ego_camera(model: RobotModel, width: int, height: int) -> Camera:
    """The lens of the robot's head camera at ``width`` by ``height``, at its resting pose."""
    return model.camera(width, height)

"""The candidate stream V_0: every camera pose of the accepted rollouts (Eq. 2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..cameras import Camera
from .model import RobotModel
from .rollouts import Rollout


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


def candidate_stream(rollouts: Sequence[Rollout]) -> Candidates:
    """The frames of the successful ``rollouts``; failed ones are passed over."""
    accepted = [rollout for rollout in rollouts if rollout.success]
    lengths = [len(rollout.camera_poses) for rollout in accepted]
    return Candidates(
        poses=np.concatenate([np.empty((0, 4, 4)), *(rollout.camera_poses for rollout in accepted)]),
        rollout=np.repeat(np.arange(len(accepted), dtype=np.int32), lengths),
        frame=np.concatenate([np.empty(0, np.int32), *(np.arange(n, dtype=np.int32) for n in lengths)]),
    )


def ego_camera(model: RobotModel, width: int, height: int) -> Camera:
    """The lens of the robot's head camera at ``width`` by ``height``, at its resting pose."""
    return model.camera(width, height)

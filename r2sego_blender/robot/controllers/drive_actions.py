"""What a policy of the commanded drive is told of the body, and what its numbers command."""

from __future__ import annotations

import mujoco
import numpy as np

from ...core.errors import RobotError
from ..model.composition import Composition
from .commanded_drive import DriveCommand, DriveLimits

SIZE = 4
"""Ahead, left and turning left, as shares of the drive's limits; above 0 the last says to sit."""

NAMES = ("vx", "vy", "yaw_rate", "sit")
"""Of these numbers."""

MOST = 1000.0
"""Bound of what is felt; a robot that falls stays far below."""


def command_of(action: np.ndarray, limits: DriveLimits = DriveLimits()) -> DriveCommand:
    """What ``action`` (4,) in [-1, 1] says: 1 is the upper limit, -1 the lower one, 0 stands still.

    Raises RobotError for an action of another shape or with a number that is none.
    """
    shares = np.asarray(action, np.float64)
    if shares.shape != (SIZE,) or not np.isfinite(shares).all():
        raise RobotError(
            f"an action is {SIZE} finite numbers, not {np.array2string(shares, threshold=8)} of shape {shares.shape}",
            where="action",
            cure=f"Give {', '.join(NAMES)}, each in [-1, 1].",
        )
    shares = np.clip(shares, -1.0, 1.0)
    vx, vy, rate = (
        float(share) * (high if share > 0.0 else -low)
        for share, (low, high) in zip(shares[:3], _ranges(limits), strict=True)
    )
    return DriveCommand(vx, vy, rate, sit=bool(shares[3] > 0.0))


def action_of(command: DriveCommand, limits: DriveLimits = DriveLimits()) -> np.ndarray:
    """(4,) float32 in [-1, 1], the action that says ``command``; what is beyond the limits says them."""
    wanted = command.vx_m_s, command.vy_m_s, command.yaw_rate_rad_s
    shares = [
        value / (high if value > 0.0 else -low) for value, (low, high) in zip(wanted, _ranges(limits), strict=True)
    ]
    return np.clip([*shares, 1.0 if command.sit else -1.0], -1.0, 1.0).astype(np.float32)


def proprioception_size(joints: int) -> int:
    """Numbers of ``proprioception`` of a robot with so many ``joints``."""
    return 6 + 2 * joints + SIZE


def proprioception(
    data: mujoco.MjData, composition: Composition, rest_qpos: np.ndarray, last_action: np.ndarray
) -> np.ndarray:
    """(P,) float32: gravity and angular velocity in the base's frame, joints from ``rest_qpos`` (nq,), their
    velocities, and the last action (4,); each within ``MOST``."""
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, data.qpos[3:7])
    address = composition.qpos_address
    # A free joint's angular velocity is its body's own.
    felt = np.concatenate(
        [
            -turn.reshape(3, 3)[2],
            data.qvel[3:6],
            data.qpos[address] - rest_qpos[address],
            data.qvel[composition.joint_dof_address],
            last_action,
        ],
        dtype=np.float32,
    )
    return np.clip(felt, -MOST, MOST)


def _ranges(limits: DriveLimits) -> tuple[tuple[float, float], ...]:
    return limits.vx_m_s, limits.vy_m_s, limits.yaw_rate_rad_s

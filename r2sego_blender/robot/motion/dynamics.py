"""Inverse dynamics of a reference motion whose feet, wheels or seat carry the weight."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy import ndimage

from ..behaviours.trajectory import RATE_HZ
from ..model.model import RobotModel
from ..motion.gait import Gait

# Accelerations are smoothed over this many frames: footsteps begin and end abruptly.
_SMOOTHING = 1.5


def velocities(model: mujoco.MjModel, qpos: np.ndarray) -> np.ndarray:
    """(T, nv) central differences of ``qpos`` (T, nq) at ``RATE_HZ``."""
    last = len(qpos) - 1
    qvel = np.empty((len(qpos), model.nv))
    for frame, velocity in enumerate(qvel):
        after, before = min(frame + 1, last), max(frame - 1, 0)
        mujoco.mj_differentiatePos(model, velocity, (after - before) / RATE_HZ, qpos[before], qpos[after])
    return qvel


def inverse_dynamics(
    robot: RobotModel, qpos: np.ndarray, gait: Gait, floor_z_m: float, seat_load: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Velocities (T, nv) and torques (T, nv) of a motion whose feet carry their loads.

    The feet's forces act where they balance the body, or at the soles' nearest point; what
    they cannot balance stays in the base's six rows, as the residual wrench. ``seat_load``
    (T,) is the share of everything that a seat carries instead; wheels carry all weight.
    """
    model = robot.model
    data = mujoco.MjData(model)
    qvel = velocities(model, qpos)
    qacc = ndimage.gaussian_filter1d(np.gradient(qvel, 1.0 / RATE_HZ, axis=0), _SMOOTHING, axis=0)
    torque = np.empty_like(qvel)
    jacobian = np.empty((3, model.nv))
    on_feet = np.ones(len(qpos)) if seat_load is None else 1.0 - seat_load
    for frame in range(len(qpos)):
        data.qpos[:], data.qvel[:], data.qacc[:] = qpos[frame], qvel[frame], qacc[frame]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 1, torque[frame])
        torque[frame] += model.dof_armature * qacc[frame]
        torque[frame, :6] *= on_feet[frame]
        if robot.is_wheeled:
            torque[frame, 2:5] = 0.0  # weight, roll and pitch
            continue
        force = torque[frame, :3].copy()
        moment = data.xmat[robot.base].reshape(3, 3) @ torque[frame, 3:6]
        drop = floor_z_m - qpos[frame, 2]
        # The zero-moment point, where the whole force would balance the moment.
        balance = qpos[frame, :2] + np.array([drop * force[0] - moment[1], moment[0] + drop * force[1]]) / max(
            force[2], 1.0
        )
        load = gait.load[:, frame]
        shift = balance - load @ gait.feet[:, frame, :2]
        for leg, share, foot in zip(robot.legs, load, gait.feet[:, frame], strict=True):
            cos, sin = np.cos(foot[3]), np.sin(foot[3])
            turn = np.array([[cos, -sin], [sin, cos]])
            on_sole = np.clip(turn.T @ shift, leg.sole_low_m, leg.sole_high_m)
            point = np.array([*(foot[:2] + turn @ on_sole), floor_z_m + foot[2]])
            mujoco.mj_jac(model, data, jacobian, None, point, leg.foot)
            torque[frame] -= share * (jacobian.T @ force)
    return qvel, torque

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
        feet, load = gait.feet[:, frame], gait.load[:, frame]
        _carried(robot, data, feet, load, floor_z_m, on_feet[frame], torque[frame], jacobian)
    return qvel, torque


class FrameDynamics:
    """The same, one configuration at a time."""

    def __init__(self, robot: RobotModel, floor_z_m: float) -> None:
        self._robot, self._floor_z_m = robot, floor_z_m
        self._data, self._jacobian = mujoco.MjData(robot.model), np.empty((3, robot.model.nv))

    def torque(
        self, qpos: np.ndarray, qvel: np.ndarray, qacc: np.ndarray, feet: np.ndarray, load: np.ndarray, on_feet: float
    ) -> np.ndarray:
        """(nv,) torques at ``qpos`` (nq,), ``qvel`` and ``qacc`` (nv,).

        ``feet`` (L, 4) and ``load`` (L,) as a ``Gait`` has them of a frame; ``on_feet`` is the
        share of everything that the feet carry.
        """
        data, torque = self._data, np.empty(self._robot.model.nv)
        data.qpos[:], data.qvel[:], data.qacc[:] = qpos, qvel, qacc
        _carried(self._robot, data, feet, load, self._floor_z_m, on_feet, torque, self._jacobian)
        return torque


def _carried(
    robot: RobotModel,
    data: mujoco.MjData,
    feet: np.ndarray,
    load: np.ndarray,
    floor_z_m: float,
    on_feet: float,
    torque: np.ndarray,
    jacobian: np.ndarray,
) -> None:
    """Write the torques of the motion in ``data`` into ``torque`` (nv,); ``jacobian`` (3, nv) is scratch."""
    model = robot.model
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_comVel(model, data)
    mujoco.mj_rne(model, data, 1, torque)
    torque += model.dof_armature * data.qacc
    torque[:6] *= on_feet
    if robot.is_wheeled:
        torque[2:5] = 0.0  # weight, roll and pitch
        return
    force = torque[:3].copy()
    moment = data.xmat[robot.base].reshape(3, 3) @ torque[3:6]
    place = data.qpos[:3]
    drop = floor_z_m - place[2]
    # The zero-moment point, where the whole force would balance the moment.
    balance = place[:2] + np.array([drop * force[0] - moment[1], moment[0] + drop * force[1]]) / max(force[2], 1.0)
    shift = balance - load @ feet[:, :2]
    for leg, share, foot in zip(robot.legs, load, feet, strict=True):
        cos, sin = np.cos(foot[3]), np.sin(foot[3])
        turn = np.array([[cos, -sin], [sin, cos]])
        on_sole = np.minimum(np.maximum(turn.T @ shift, leg.sole_low_m), leg.sole_high_m)
        point = np.array([*(foot[:2] + turn @ on_sole), floor_z_m + foot[2]])
        mujoco.mj_jac(model, data, jacobian, None, point, leg.foot)
        torque -= share * (jacobian.T @ force)

"""Reference motions of walking and looking: joint trajectories the controller tracks."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy import ndimage

from .free_floor import FreeFloor
from .gait import Gait, plan_gait
from .kinematics import LegSolver
from .model import RobotModel
from .mount import CameraMount
from .navigation import RATE_HZ, RootTrajectory, draw, plan_root
from .scope import BehaviourScope

_ARM_SWING_RAD = 0.3
# Fastest gaze: the camera turns no quicker than an unhurried person's head.
_GAZE_RATE_RAD_S = math.radians(75.0)
_MIN_GAZE_S = 0.4
# Accelerations are smoothed over this many frames: footsteps begin and end abruptly.
_SMOOTHING = 1.5


@dataclass(frozen=True)
class ReferenceMotion:
    """A robot's reference at ``RATE_HZ``.

    ``qpos`` (T, nq), ``qvel`` (T, nv) and ``torque`` (T, nv) float64, MuJoCo's coordinates:
    the joints' torques of the inverse dynamics and, in the base's rows, the residual wrench;
    ``goal`` (2,) is where it has to end; ``mount`` the camera of this rollout.
    """

    behaviour: str
    qpos: np.ndarray
    qvel: np.ndarray
    torque: np.ndarray
    goal: np.ndarray
    mount: CameraMount


def plan_motion(
    robot: RobotModel, floor: FreeFloor, scope: BehaviourScope, rng: np.random.Generator
) -> ReferenceMotion | None:
    """Draw a walking-and-looking motion in the scope; None where the floor offers no goal."""
    root = plan_root(floor, scope, rng)
    if root is None:
        return None
    height_m = robot.rest_height_m * draw(scope.start.pelvis_height, rng)
    pitch = scope.look.camera_pitch_deg
    mount = robot.mount if pitch is None else robot.mount.pitched(draw(pitch, rng))
    gait = plan_gait(root, robot.foot_offsets_m)
    qpos = _upper_body(robot, root, gait, scope, rng)
    cos, sin = np.cos(root.yaw), np.sin(root.yaw)
    qpos[:, 0] = root.xy[:, 0] - sin * gait.sway_m
    qpos[:, 1] = root.xy[:, 1] + cos * gait.sway_m
    qpos[:, 2] = floor.floor_z_m + height_m + gait.bob_m
    qpos[:, 3:7] = 0.0
    qpos[:, 3], qpos[:, 6] = np.cos(root.yaw / 2.0), np.sin(root.yaw / 2.0)
    soles = gait.feet.copy()
    soles[..., 2] += floor.floor_z_m + np.array([[leg.sole_m] for leg in robot.legs])
    LegSolver(robot).solve(qpos, soles)
    qvel, torque = _inverse_dynamics(robot, qpos, gait, floor.floor_z_m)
    return ReferenceMotion(root.behaviour, qpos, qvel, torque, root.goal, mount)


def _upper_body(
    robot: RobotModel, root: RootTrajectory, gait: Gait, scope: BehaviourScope, rng: np.random.Generator
) -> np.ndarray:
    """(T, nq): the resting posture with the waist looking around and the arms swinging."""
    model = robot.model
    qpos = np.tile(robot.rest_qpos, (len(root.yaw), 1))
    yaw, pitch = _gaze(len(root.yaw), scope, rng)
    for joint, angle in ((robot.waist_yaw, yaw), (robot.waist_pitch, pitch)):
        if joint is not None:
            sign = np.sign(model.jnt_axis[joint][np.argmax(np.abs(model.jnt_axis[joint]))])
            low, high = model.jnt_range[joint] if model.jnt_limited[joint] else (-np.inf, np.inf)
            qpos[:, model.jnt_qposadr[joint]] = np.clip(sign * angle, low, high)
    for joint, side in zip(robot.shoulders, (1.0, -1.0), strict=False):
        qpos[:, model.jnt_qposadr[joint]] += side * _ARM_SWING_RAD * gait.swing
    return qpos


def _gaze(frames: int, scope: BehaviourScope, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Waist yaw and pitch (T,) radians: gazes drawn from the scope, held, eased between."""
    times = np.arange(frames) / RATE_HZ
    limits = np.radians([scope.look.waist_yaw_deg, scope.look.waist_pitch_deg])
    gaze = rng.uniform(limits[:, 0], limits[:, 1])
    angles = np.tile(gaze, (frames, 1))
    at_s = 0.0
    while at_s < times[-1]:
        start_s = at_s + draw(scope.look.hold_s, rng)
        target = rng.uniform(limits[:, 0], limits[:, 1])
        # The eased turn's greatest rate is 1.875 times its mean rate.
        moving_s = max(_MIN_GAZE_S, 1.875 * float(np.abs(target - gaze).max()) / _GAZE_RATE_RAD_S)
        phase = np.clip((times - start_s) / moving_s, 0.0, 1.0)[:, None]
        angles += phase**3 * (10.0 - 15.0 * phase + 6.0 * phase**2) * (target - gaze)
        gaze, at_s = target, start_s + moving_s
    return angles[:, 0], angles[:, 1]


def _inverse_dynamics(
    robot: RobotModel, qpos: np.ndarray, gait: Gait, floor_z_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Velocities (T, nv) and torques (T, nv) of a motion whose feet carry their loads.

    The feet's forces act where they balance the body, or at the soles' nearest point; what
    they cannot balance stays in the base's six rows, as the residual wrench.
    """
    model = robot.model
    data = mujoco.MjData(model)
    qvel = np.empty((len(qpos), model.nv))
    after, before = (
        np.minimum(np.arange(len(qpos)) + 1, len(qpos) - 1),
        np.maximum(np.arange(len(qpos)) - 1, 0),
    )
    for frame in range(len(qpos)):
        seconds = (after[frame] - before[frame]) / RATE_HZ
        mujoco.mj_differentiatePos(model, qvel[frame], seconds, qpos[before[frame]], qpos[after[frame]])
    qacc = ndimage.gaussian_filter1d(np.gradient(qvel, 1.0 / RATE_HZ, axis=0), _SMOOTHING, axis=0)
    torque = np.empty_like(qvel)
    jacobian = np.empty((3, model.nv))
    for frame in range(len(qpos)):
        data.qpos[:], data.qvel[:], data.qacc[:] = qpos[frame], qvel[frame], qacc[frame]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 1, torque[frame])
        torque[frame] += model.dof_armature * qacc[frame]
        force = torque[frame, :3].copy()
        moment = data.xmat[robot.base].reshape(3, 3) @ torque[frame, 3:6]
        drop = floor_z_m - qpos[frame, 2]
        # The zero-moment point, where the whole force would balance the moment.
        balance = qpos[frame, :2] + np.array(
            [drop * force[0] - moment[1], moment[0] + drop * force[1]]
        ) / max(force[2], 1.0)
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

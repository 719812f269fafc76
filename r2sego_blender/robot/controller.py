"""The embedded controller: a reference motion tracked in MuJoCo, not a learned policy.

Position servos drive every joint towards the reference, with the torques of its inverse
dynamics fed forward. Balance is not theirs: a spring-damper wrench on the pelvis, bounded on
each axis (a residual force, as motion-tracking controllers use), holds the base to the
reference. Gravity, contact, joint limits and effort limits act as they do; what pushes the
robot harder than the bounds makes it fall or stray, and the rollout fails.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import mujoco
import numpy as np

from .composition import Composition, geom_bounds
from .free_floor import FLATNESS_M, FreeFloor
from .motion import ReferenceMotion
from .navigation import RATE_HZ
from .scope import BehaviourScope

_CHECK_S = 0.02
# On scene geoms that are more than floor a foot may stand where they are as flat as this.
_FLOOR_NORMAL_Z = 0.7


class Reason(StrEnum):
    """Why a rollout failed; ``NONE`` is a success."""

    NONE = ""
    NO_GOAL = "no_goal"
    FALL = "fall"
    BODY_CONTACT = "body_contact"
    LEFT_REGION = "left_region"
    TIME_OUT = "time_out"
    JOINT_LIMIT = "joint_limit"
    NON_FINITE = "non_finite"


@dataclass(frozen=True)
class Tracked:
    """A tracked motion: ``qpos`` (T, nq) at the camera's rate, up to the failure if any."""

    qpos: np.ndarray
    times_s: np.ndarray
    reason: Reason
    detail: str


class Tracker:
    """Runs reference motions of one robot in one scene."""

    def __init__(
        self, composition: Composition, floor: FreeFloor, scope: BehaviourScope, rest_height_m: float
    ) -> None:
        self._composition = composition
        self._floor = floor
        self._scope = scope
        self._lowest_m = floor.floor_z_m + scope.failures.fall_height * rest_height_m
        self._data = mujoco.MjData(composition.model)
        _, high = geom_bounds(composition.model)
        self._floor_geoms = composition.scene_geoms & (high[:, 2] < floor.floor_z_m + FLATNESS_M)

    def track(self, motion: ReferenceMotion) -> Tracked:
        """Simulate ``motion`` until it ends or fails."""
        model, data = self._composition.model, self._data
        step_s = model.opt.timestep
        steps = round((len(motion.qpos) - 1) / RATE_HZ / step_s)
        base, control = self._references(motion, steps)
        mujoco.mj_resetData(model, data)
        data.qpos[:] = motion.qpos[0]
        frame_steps = 1.0 / (self._scope.episode.camera_rate_hz * step_s)
        check_steps = max(1, round(_CHECK_S / step_s))
        qpos, times, reason, detail = [], [], Reason.NONE, ""
        for step in range(steps + 1):
            if step >= len(qpos) * frame_steps - 1e-9:
                qpos.append(data.qpos.copy())
                times.append(step * step_s)
            if step == steps:
                break
            data.ctrl[:] = control[step]
            data.mocap_pos[0], data.mocap_quat[0] = base[step, :3], base[step, 3:]
            mujoco.mj_step(model, data)
            if step % check_steps == 0:
                reason, detail = self._failure()
                if reason:
                    break
        if not reason:
            missed_m = math.dist(data.qpos[:2], motion.goal)
            if missed_m > self._scope.failures.goal_distance_m:
                reason, detail = Reason.TIME_OUT, f"{missed_m:.2f} m from the goal"
        return Tracked(np.array(qpos), np.array(times), reason, detail)

    def _references(self, motion: ReferenceMotion, steps: int) -> tuple[np.ndarray, np.ndarray]:
        """The base's pose (steps, 7) and the actuators' controls (steps, nu)."""
        composition = self._composition
        at = np.arange(steps) * composition.model.opt.timestep * RATE_HZ
        frame = np.minimum(at.astype(int), len(motion.qpos) - 2)
        part = (at - frame)[:, None]
        qpos = (1.0 - part) * motion.qpos[frame] + part * motion.qpos[frame + 1]
        qvel = (1.0 - part) * motion.qvel[frame] + part * motion.qvel[frame + 1]
        torque = (1.0 - part) * motion.torque[frame] + part * motion.torque[frame + 1]
        base = qpos[:, :7]
        base[:, 3:] /= np.linalg.norm(base[:, 3:], axis=1, keepdims=True)
        # The tracking wrench acts along the reference's axes; it only yaws.
        yaw = 2.0 * np.arctan2(base[:, 6], base[:, 3])
        for vector in (qvel, torque):
            x, y = vector[:, 0].copy(), vector[:, 1].copy()
            vector[:, 0] = np.cos(yaw) * x + np.sin(yaw) * y
            vector[:, 1] = np.cos(yaw) * y - np.sin(yaw) * x
        # A servo damps absolute velocity; aiming ahead makes it damp the error's instead.
        address = composition.dof_address
        control = (composition.damping * qvel[:, address] + torque[:, address]) / composition.stiffness
        control[:, 6:] += qpos[:, composition.qpos_address]
        return base, control

    def _failure(self) -> tuple[Reason, str]:
        """The first failure condition that holds now, and its particulars."""
        data, failures = self._data, self._scope.failures
        if not (np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all()):
            return Reason.NON_FINITE, "the simulation diverged"
        if data.qpos[2] < self._lowest_m:
            return Reason.FALL, f"the pelvis sank to {data.qpos[2]:.2f} m"
        _, x, y, _ = data.qpos[3:7]
        tilt_deg = math.degrees(math.acos(max(-1.0, 1.0 - 2.0 * (x * x + y * y))))
        if tilt_deg > failures.fall_tilt_deg:
            return Reason.FALL, f"the pelvis tilted by {tilt_deg:.0f} degrees"
        if failures.body_contact and (touched := self._body_contact()):
            return Reason.BODY_CONTACT, touched
        if failures.leaving_region and not self._floor.in_region(data.qpos[:2]):
            return Reason.LEFT_REGION, f"the pelvis came to ({data.qpos[0]:.2f}, {data.qpos[1]:.2f})"
        return self._joint_limit()

    def _body_contact(self) -> str:
        """What of the robot touches what of the scene, but for feet on the floor."""
        composition, contact = self._composition, self._data.contact
        if not len(contact.dist):
            return ""
        geoms = contact.geom
        feet = composition.foot_geoms[geoms].any(axis=1)
        flat = np.abs(contact.frame[:, 2]) > _FLOOR_NORMAL_Z
        flat &= np.abs(contact.pos[:, 2] - self._floor.floor_z_m) < FLATNESS_M
        floor = self._floor_geoms[geoms].any(axis=1) | flat
        wrong = np.flatnonzero((contact.dist < 0.0) & ~(feet & floor))
        if not len(wrong):
            return ""
        first, second = geoms[wrong[0]]
        robot, scene = (second, first) if composition.scene_geoms[first] else (first, second)
        return f"{composition.geom_label(robot)} touched {composition.geom_label(scene)}"

    def _joint_limit(self) -> tuple[Reason, str]:
        model, data = self._composition.model, self._data
        limited = model.jnt_limited.astype(bool)
        angles = data.qpos[model.jnt_qposadr[limited]]
        low, high = model.jnt_range[limited].T
        beyond = np.maximum(low - angles, angles - high)
        worst = int(np.argmax(beyond))
        excess_deg = math.degrees(beyond[worst])
        if excess_deg <= self._scope.failures.joint_limit_deg:
            return Reason.NONE, ""
        joint = int(np.flatnonzero(limited)[worst])
        return Reason.JOINT_LIMIT, f"{self._composition.joint_label(joint)} by {excess_deg:.1f} degrees"

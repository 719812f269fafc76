"""Inverse kinematics of the legs, all frames of a motion at once: feet to their references, base given."""

from __future__ import annotations

from typing import Protocol

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from .structure import Leg, ancestors, is_hinge, joints_of

_ITERATIONS = 40
_STILL_RAD = 1e-7
_LONGEST_STEP_RAD = 0.5
_DAMPING, _ERROR_DAMPING = 1e-8, 0.02
# Rotation errors count as metres at this arm, about a foot's half length; at a short one where
# the leg cannot turn its foot in every way, so that its place is kept all the same.
_ARM_M, _SHORT_ARM_M = 0.1, 0.03
_EVERY_WAY_HINGES = 6
# References keep this far inside the joints' limits.
_LIMIT_MARGIN_RAD = 0.02


class Legged(Protocol):
    """What the solver asks of a robot; see ``model.RobotModel``."""

    @property
    def model(self) -> mujoco.MjModel: ...
    @property
    def base(self) -> int: ...
    @property
    def legs(self) -> tuple[Leg, ...]: ...
    @property
    def rest_qpos(self) -> np.ndarray: ...


class LegSolver:
    """Every leg's inverse kinematics, each frame started from the robot's rest posture.

    So a frame's solution depends on that frame alone, and a smooth motion stays smooth.
    """

    def __init__(self, robot: Legged) -> None:
        self._chains = [LegChain(robot.model, robot.base, leg) for leg in robot.legs]
        self._rest_qpos = robot.rest_qpos

    def solve(self, qpos: np.ndarray, soles: np.ndarray) -> np.ndarray:
        """Write the legs' joints into ``qpos`` (T, nq) in place.

        ``soles`` (L, T, 4): x, y, z (m) of each foot's tip (see ``structure.Leg``) and its yaw
        (rad), flat feet kept level. Where a foot cannot be reached the nearest posture is
        taken: returns (L, T) float64, the metres by which each tip misses its place.
        """
        missed_m = np.empty(soles.shape[:2])
        for chain, sole, missed in zip(self._chains, soles, missed_m, strict=True):
            seeds = np.tile(self._rest_qpos[chain.address], (len(qpos), 1))
            qpos[:, chain.address], missed[:] = chain.solve(qpos, sole, seeds)
        return missed_m


class LegChain:
    """One leg from the base to its foot: damped least squares (Levenberg-Marquardt) on its own joints.

    ``address`` (n,) int of the joints in qpos; ``low`` and ``high`` (n,) their limits, radians;
    ``arm_m`` the metres as which a radian of the foot counts.
    """

    def __init__(self, model: mujoco.MjModel, base: int, leg: Leg) -> None:
        self._model, self._leg = model, leg
        self._bodies = [body for body in ancestors(model, leg.foot) if body != base]
        quaternions = model.body_quat[self._bodies]
        self._turns = Rotation.from_quat(quaternions, scalar_first=True).as_matrix()
        joints = list(leg.joints)
        self.address = model.jnt_qposadr[joints]
        limited = model.jnt_limited[joints].astype(bool)
        self.low = np.where(limited, model.jnt_range[joints, 0] + _LIMIT_MARGIN_RAD, -np.inf)
        self.high = np.where(limited, model.jnt_range[joints, 1] - _LIMIT_MARGIN_RAD, np.inf)
        self.arm_m = _ARM_M if len(joints) >= _EVERY_WAY_HINGES else _SHORT_ARM_M

    def solve(self, qpos: np.ndarray, sole: np.ndarray, seeds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Joints (T, n) that take the foot to ``sole`` (T, 4), and by how many metres (T,) it misses.

        ``qpos`` (T, nq) gives the base's pose and the joints between it and the leg;
        ``seeds`` (T, n) are where the search begins.
        """
        base = Rotation.from_quat(qpos[:, 3:7], scalar_first=True)
        place = base.inv().apply(sole[:, :3] - qpos[:, :3])
        level = (base.inv() * Rotation.from_euler("z", sole[:, 3:])).as_matrix() @ self._leg.base_from_foot
        joints = np.clip(seeds, self.low, self.high)
        moving = np.arange(len(qpos))
        for _ in range(_ITERATIONS):
            angles = joints[moving]
            step = self._step(qpos[moving], angles, place[moving], level[moving])
            joints[moving] = np.clip(angles + step, self.low, self.high)
            moving = moving[np.abs(joints[moving] - angles).max(axis=1) > _STILL_RAD]
            if not len(moving):
                break
        foot = self._forward(qpos, joints)[0]
        return joints, np.linalg.norm(place - foot, axis=1)

    def _step(self, qpos: np.ndarray, angles: np.ndarray, place: np.ndarray, level: np.ndarray) -> np.ndarray:
        """(T, n) one bounded Gauss-Newton step; joints that press against a limit rest."""
        foot, turn, anchors, axes = self._forward(qpos, angles)
        error = place - foot
        jacobian = np.cross(axes, foot[:, None] - anchors)
        if self._leg.is_flat:
            off = level @ turn.transpose(0, 2, 1)
            off = off - off.transpose(0, 2, 1)
            rotated = 0.5 * np.stack([off[:, 2, 1], off[:, 0, 2], off[:, 1, 0]], axis=1)
            error = np.concatenate([error, self.arm_m * rotated], axis=1)
            jacobian = np.concatenate([jacobian, self.arm_m * axes], axis=2)
        downhill = np.einsum("tnk,tk->tn", jacobian, error)
        pressed = ((angles <= self.low) & (downhill < 0.0)) | ((angles >= self.high) & (downhill > 0.0))
        jacobian[pressed], downhill[pressed] = 0.0, 0.0
        normal = jacobian @ jacobian.transpose(0, 2, 1)
        damping = _DAMPING + _ERROR_DAMPING * (error**2).sum(axis=1)
        normal += damping[:, None, None] * np.eye(angles.shape[1])
        step = np.linalg.solve(normal, downhill[..., None])[..., 0]
        longest = np.abs(step).max(axis=1, keepdims=True)
        return step * np.minimum(1.0, _LONGEST_STEP_RAD / np.maximum(longest, _LONGEST_STEP_RAD))

    def _forward(self, qpos: np.ndarray, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """In the base's frame: the foot's tip (T, 3) and axes (T, 3, 3), the joints' anchors and
        axes (T, n, 3)."""
        model = self._model
        place, turn = np.zeros((len(qpos), 3)), np.tile(np.eye(3), (len(qpos), 1, 1))
        anchors, axes = np.empty((*angles.shape, 3)), np.empty((*angles.shape, 3))
        for body, body_turn in zip(self._bodies, self._turns, strict=True):
            place = place + turn @ model.body_pos[body]
            turn = turn @ body_turn
            for joint in joints_of(model, body):
                address = model.jnt_qposadr[joint]
                anchor, axis = place + turn @ model.jnt_pos[joint], turn @ model.jnt_axis[joint]
                value = qpos[:, address]
                if joint in self._leg.joints:
                    column = self._leg.joints.index(joint)
                    value = angles[:, column]
                    anchors[:, column], axes[:, column] = anchor, axis
                value = value - model.qpos0[address]
                if is_hinge(model, joint):
                    turn = turn @ _turns_about(model.jnt_axis[joint], value)
                    place = anchor - turn @ model.jnt_pos[joint]
                else:
                    place = place + axis * value[:, None]
        return place + turn @ self._leg.tip, turn, anchors, axes


def _turns_about(axis: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """(T, 3, 3) rotations about one unit ``axis`` (3,) by ``angles`` (T,), Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sin, cos = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    return np.eye(3) + sin * cross + (1.0 - cos) * (cross @ cross)

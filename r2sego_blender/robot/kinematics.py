"""Differential inverse kinematics of the legs: feet to their references, base given."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from .model import Leg, RobotModel

_ITERATIONS = 12
_TOLERANCE_M = 2e-4
_DAMPING = 1e-4
# Rotation errors count as metres at this arm, about a foot's half length.
_ARM_M = 0.1
# References keep this far inside the joints' limits.
_LIMIT_MARGIN_RAD = 0.02
# A straight knee is singular: solutions start from one bent by this much.
_KNEE_BEND_RAD = 0.3
_ONE_SIDED_RAD = 0.6


class LegSolver:
    """Damped least squares on each leg's own joints, started from the frame before."""

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self._model = robot.model
        self._data = mujoco.MjData(robot.model)
        self._jacobian = np.zeros((6, robot.model.nv))

    def solve(self, qpos: np.ndarray, soles: np.ndarray) -> None:
        """Write the legs' joints into ``qpos`` (T, nq) in place.

        ``soles`` (2, T, 4): x, y, z (m) of each foot body's origin and its yaw (rad), the
        foot kept level. Where a foot cannot be reached the nearest posture is taken.
        """
        model = self._model
        legs = [(leg, *self._addresses(leg)) for leg in self._robot.legs]
        seeds = [self._seed(leg) for leg in self._robot.legs]
        for frame, configuration in enumerate(qpos):
            self._data.qpos[:] = configuration
            for (_, address, _, _), seed in zip(legs, seeds, strict=True):
                self._data.qpos[address] = seed
            for _ in range(_ITERATIONS):
                mujoco.mj_kinematics(model, self._data)
                mujoco.mj_comPos(model, self._data)
                worst = 0.0
                for (leg, address, dof, limits), target in zip(legs, soles[:, frame], strict=True):
                    worst = max(worst, self._step(leg, address, dof, limits, target))
                if worst < _TOLERANCE_M:
                    break
            for index, (_, address, _, _) in enumerate(legs):
                seeds[index] = configuration[address] = self._data.qpos[address]

    def _step(
        self, leg: Leg, address: np.ndarray, dof: np.ndarray, limits: np.ndarray, target: np.ndarray
    ) -> float:
        """One Gauss-Newton step of one leg; the error before it, metres."""
        data = self._data
        mujoco.mj_jacBody(self._model, data, self._jacobian[:3], self._jacobian[3:], leg.foot)
        jacobian = self._jacobian[:, dof]
        error = np.empty(6)
        error[:3] = target[:3] - data.xpos[leg.foot]
        error[3:] = _ARM_M * _turn_to_level(data.xmat[leg.foot], target[3])
        jacobian[3:] *= _ARM_M
        size = math.sqrt(error @ error)
        if size >= _TOLERANCE_M:
            damped = jacobian @ jacobian.T
            damped[np.diag_indices(6)] += _DAMPING
            moved = data.qpos[address] + jacobian.T @ np.linalg.solve(damped, error)
            data.qpos[address] = np.clip(moved, limits[0], limits[1])
        return size

    def _addresses(self, leg: Leg) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        joints = list(leg.joints)
        limited = self._model.jnt_limited[joints].astype(bool)
        low = np.where(limited, self._model.jnt_range[joints, 0] + _LIMIT_MARGIN_RAD, -np.inf)
        high = np.where(limited, self._model.jnt_range[joints, 1] - _LIMIT_MARGIN_RAD, np.inf)
        return self._model.jnt_qposadr[joints], self._model.jnt_dofadr[joints], np.stack([low, high])

    def _seed(self, leg: Leg) -> np.ndarray:
        """The leg's resting joints with the knee bent the way its limits allow."""
        model, joints = self._model, list(leg.joints)
        seed = self._robot.rest_qpos[model.jnt_qposadr[joints]].copy()
        middle = model.jnt_range[joints].mean(axis=1)
        bends = (np.abs(model.jnt_axis[joints, 1]) > 0.9) & (np.abs(middle) > _ONE_SIDED_RAD)
        return np.where(bends, np.sign(middle) * _KNEE_BEND_RAD, seed)


def _turn_to_level(matrix: np.ndarray, yaw: float) -> np.ndarray:
    """(3,) the small world rotation that takes a body's axes (9,) to level with ``yaw``."""
    (ax, bx, cx), (ay, by, cy), (az, bz, _) = matrix.reshape(3, 3)
    cos, sin = math.cos(yaw), math.sin(yaw)
    # Half the sum of the cross products of each axis with its target.
    return 0.5 * np.array(
        [-az * sin - bz * cos + cy, az * cos - bz * sin - cx, ax * sin - ay * cos + bx * cos + by * sin]
    )

"""Inverse kinematics of the legs, one configuration after another, each started from the last."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from .kinematics import LegChain, Legged
from .structure import Leg

_ITERATIONS = 12
# The next step is about its square.
_STILL_RAD = 2e-3
_LONGEST_STEP_RAD = 0.5
# A foot that misses its place by more is looked for once more, from the rest posture.
_ASTRAY_M = 1e-3
_DAMPING, _ERROR_DAMPING = 1e-8, 0.02


@dataclass(frozen=True)
class _Tracked:
    leg: Leg
    chain: LegChain
    dof: np.ndarray
    damping: np.ndarray  # (n, n) identity


class LegTracker:
    """What ``LegSolver`` does, for a motion that is not known ahead.

    MuJoCo's kinematics of one configuration at a time: the next one of a smooth motion is a
    step or two away.
    """

    def __init__(self, robot: Legged) -> None:
        model = robot.model
        self._model, self._data = model, mujoco.MjData(model)
        self._rest_qpos = robot.rest_qpos
        self._legs = []
        for leg in robot.legs:
            dof = model.jnt_dofadr[list(leg.joints)]
            self._legs.append(_Tracked(leg, LegChain(model, robot.base, leg), dof, np.eye(len(dof))))
        self._jacobian = np.empty((6, model.nv))
        self.restart()

    def restart(self) -> None:
        """Start the next configuration from the robot's rest posture."""
        self._angles = [self._rest_qpos[one.chain.address] for one in self._legs]

    def solve(self, qpos: np.ndarray, soles: np.ndarray) -> None:
        """Write the legs' joints into ``qpos`` (nq,) in place; ``soles`` (L, 4) as ``LegSolver.solve`` takes them.

        Where a foot cannot be reached the nearest posture is taken.
        """
        self._search(qpos, soles, list(range(len(self._legs))))
        missed_m = self.missed_m(qpos, soles)
        astray = np.flatnonzero(missed_m > _ASTRAY_M).tolist()
        if not astray:
            return
        # A knee that was stretched may have come out on the wrong side.
        found = list(self._angles)
        for index in astray:
            self._angles[index] = self._rest_qpos[self._legs[index].chain.address]
        self._search(qpos, soles, list(astray))
        worse = self.missed_m(qpos, soles) > missed_m
        for index in astray:
            if worse[index]:
                self._angles[index] = qpos[self._legs[index].chain.address] = found[index]

    def _search(self, qpos: np.ndarray, soles: np.ndarray, moving: list[int]) -> None:
        model, data = self._model, self._data
        for one, angles in zip(self._legs, self._angles, strict=True):
            qpos[one.chain.address] = angles
        for _ in range(_ITERATIONS):
            data.qpos[:] = qpos
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            for index in tuple(moving):
                one, angles = self._legs[index], self._angles[index]
                after = angles + self._step(one, angles, soles[index])
                after = np.minimum(np.maximum(after, one.chain.low), one.chain.high)
                if np.abs(after - angles).max() < _STILL_RAD:
                    moving.remove(index)
                qpos[one.chain.address] = self._angles[index] = after
            if not moving:
                break

    def missed_m(self, qpos: np.ndarray, soles: np.ndarray) -> np.ndarray:
        """(L,) float64 by how many metres the tips of ``qpos`` (nq,) miss ``soles`` (L, 4)."""
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        tips = np.array([one.leg.tip_place(self._data) for one in self._legs]).reshape(-1, 3)
        return np.linalg.norm(soles[:, :3] - tips, axis=1)

    def _step(self, one: _Tracked, angles: np.ndarray, sole: np.ndarray) -> np.ndarray:
        """(n,) one bounded Gauss-Newton step; joints that press against a limit rest."""
        data, leg, jacobian = self._data, one.leg, self._jacobian
        turn = data.xmat[leg.foot].reshape(3, 3)
        tip = data.xpos[leg.foot] + turn @ leg.tip
        mujoco.mj_jac(self._model, data, jacobian[:3], jacobian[3:], tip, leg.foot)
        own = jacobian[:, one.dof]
        error = np.zeros(6)
        error[:3] = sole[:3] - tip
        if leg.is_flat:
            cos, sin = math.cos(sole[3]), math.sin(sole[3])
            level = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]) @ leg.base_from_foot
            off = level @ turn.T
            half_arm = 0.5 * one.chain.arm_m
            error[3:] = (
                half_arm * (off[2, 1] - off[1, 2]),
                half_arm * (off[0, 2] - off[2, 0]),
                half_arm * (off[1, 0] - off[0, 1]),
            )
            own[3:] *= one.chain.arm_m
        else:
            own[3:] = 0.0
        downhill = own.T @ error
        pressed = ((angles <= one.chain.low) & (downhill < 0.0)) | ((angles >= one.chain.high) & (downhill > 0.0))
        if pressed.any():
            own[:, pressed], downhill[pressed] = 0.0, 0.0
        normal = own.T @ own + (_DAMPING + _ERROR_DAMPING * float(error @ error)) * one.damping
        step = np.linalg.solve(normal, downhill)
        longest = float(np.abs(step).max())
        return step if longest <= _LONGEST_STEP_RAD else step * (_LONGEST_STEP_RAD / longest)

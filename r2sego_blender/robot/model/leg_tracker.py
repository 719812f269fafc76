"""Inverse kinematics of the legs, one configuration after another, each started from those before."""

from __future__ import annotations

import mujoco
import numpy as np

from .kinematics import LegChain, Legged
from .structure import posed

_ITERATIONS = 40
# What is left after a step is about its square.
_STILL_RAD = 2e-2
# Steps towards a place out of reach are small long before they end.
_STUCK_RAD = 1e-4
_LONGEST_STEP_RAD = 0.5
# A foot that misses its place by more is looked for once more, from a posture bent
# by this share of the height.
_ASTRAY_M, _CROUCH = 4e-3, 0.25
_DAMPING, _ERROR_DAMPING, _SHORTER = 1e-8, 0.02, 30.0
# The entries of a matrix, row by row, whose differences are the axis of a small turn.
_BELOW, _ABOVE = [7, 2, 3], [5, 6, 1]


class LegTracker:
    """What ``LegSolver`` does, for a motion that is not known ahead.

    MuJoCo's kinematics of one configuration at a time and the same steps as there, of all
    legs at once: the next configuration of a smooth motion is a step or two away.
    """

    def __init__(self, robot: Legged) -> None:
        model, legs = robot.model, robot.legs
        self._model, self._data, self._rest_qpos = model, mujoco.MjData(model), robot.rest_qpos
        joints = max((len(leg.joints) for leg in legs), default=1)
        shape = len(legs), joints
        # Legs with fewer joints than others have some that count for nothing.
        self._address, dof = np.zeros(shape, int), np.zeros(shape, int)
        self._low, self._high = np.full(shape, -np.inf), np.full(shape, np.inf)
        self._counts = np.zeros((len(legs), 6, joints))
        for index, leg in enumerate(legs):
            chain, own = LegChain(model, robot.base, leg), len(leg.joints)
            self._address[index, :own], dof[index, :own] = chain.address, model.jnt_dofadr[list(leg.joints)]
            self._low[index, :own], self._high[index, :own] = chain.low, chain.high
            self._counts[index, :3, :own] = 1.0
            self._counts[index, 3:, :own] = chain.arm_m if leg.is_flat else 0.0
        self._half_arms = 0.5 * self._counts[:, 3:, 0]
        self._own = self._counts[:, 0, :] > 0.0
        self._address_own = self._address[self._own]
        self._feet = [leg.foot for leg in legs]
        self._tips = np.array([leg.tip for leg in legs]).reshape(-1, 3, 1)
        self._from_foot = np.array([leg.base_from_foot for leg in legs]).reshape(-1, 3, 3)
        self._jacobians = np.zeros((len(legs), 6, model.nv))
        self._halves = [(jacobian[:3], jacobian[3:]) for jacobian in self._jacobians]
        rows = np.arange(len(legs) * 6).reshape(-1, 6, 1) * model.nv
        self._entries = rows + dof[:, None]  # of the legs' own joints, in all Jacobians one after the other
        self._unit = np.eye(joints)
        self._bent = self._rest_qpos[self._address]
        self.restart()
        self._bent = self._crouched(robot)

    def _crouched(self, robot: Legged) -> np.ndarray:
        """Angles (L, n) well bent, from which a leg is never stretched through."""
        qpos = robot.rest_qpos.copy()
        qpos[2] *= 1.0 - _CROUCH
        data = posed(robot.model, robot.rest_qpos)
        soles = np.zeros((len(robot.legs), 4))
        soles[:, :3] = np.array([leg.tip_place(data) for leg in robot.legs]).reshape(-1, 3)
        return self._search(qpos, soles, self._angles)[0] if robot.legs else self._angles

    def restart(self) -> None:
        """Start the next configuration from the robot's rest posture."""
        self._angles = self._rest_qpos[self._address]
        self._before = self._angles

    def solve(self, qpos: np.ndarray, soles: np.ndarray) -> None:
        """Write the legs' joints into ``qpos`` (nq,) in place; ``soles`` (L, 4) as ``LegSolver.solve`` takes them.

        Where a foot cannot be reached the nearest posture is taken.
        """
        if not self._feet:
            return
        going_on = 2.0 * self._angles - self._before
        self._before = self._angles
        angles, off_m = self._search(qpos, soles, going_on)
        if off_m.max() > _ASTRAY_M:  # a knee that was stretched may have come out on the wrong side
            off_m = self._missed_m(qpos, soles, angles)
            astray = (off_m > _ASTRAY_M)[:, None]
            again, _ = self._search(qpos, soles, np.where(astray, self._bent, angles))
            better = astray & (self._missed_m(qpos, soles, again) < off_m)[:, None]
            angles = np.where(better, again, angles)
            self._before = np.where(astray, angles, self._before)
        self._angles = angles
        qpos[self._address_own] = angles[self._own]

    def missed_m(self, qpos: np.ndarray, soles: np.ndarray) -> np.ndarray:
        """(L,) float64 by how many metres the tips of ``qpos`` (nq,) miss ``soles`` (L, 4)."""
        return self._missed_m(qpos, soles, qpos[self._address])

    def _missed_m(self, qpos: np.ndarray, soles: np.ndarray, angles: np.ndarray) -> np.ndarray:
        self._data.qpos[:] = qpos
        self._data.qpos[self._address_own] = angles[self._own]
        mujoco.mj_kinematics(self._model, self._data)
        return np.linalg.norm(soles[:, :3] - self._feet_now()[0], axis=1)

    def _search(self, qpos: np.ndarray, soles: np.ndarray, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angles (L, n) from ``angles`` on, and by how much (L,) the feet were off before the last step."""
        model, data = self._model, self._data
        cos, sin = np.cos(soles[:, 3]), np.sin(soles[:, 3])
        level = self._from_foot.copy()
        level[:, 0] = cos[:, None] * self._from_foot[:, 0] - sin[:, None] * self._from_foot[:, 1]
        level[:, 1] = sin[:, None] * self._from_foot[:, 0] + cos[:, None] * self._from_foot[:, 1]
        data.qpos[:] = qpos
        best, least, boost = angles, np.full(len(soles), np.inf), np.ones(len(soles))
        for _ in range(_ITERATIONS):
            data.qpos[self._address_own] = angles[self._own]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            step, off_m, squared = self._step(angles, soles, level, boost)
            worse = squared > least
            if worse.any():  # once more from before, with a shorter step
                boost = np.where(worse, _SHORTER * boost, boost)
                angles = np.where(worse[:, None], best, angles)
                step[worse] = 0.0
            best, least = angles, np.minimum(squared, least)
            angles = np.minimum(np.maximum(angles + step, self._low), self._high)
            moved = np.abs(step).max(axis=1)
            if not worse.any() and (moved < np.where(off_m < _ASTRAY_M, _STILL_RAD, _STUCK_RAD)).all():
                return angles, off_m
        return best, off_m

    def _feet_now(self) -> tuple[np.ndarray, np.ndarray]:
        """Tips (L, 3) and axes (L, 3, 3) of the feet in the world."""
        turns = self._data.xmat[self._feet].reshape(-1, 3, 3)
        return self._data.xpos[self._feet] + (turns @ self._tips)[:, :, 0], turns

    def _step(
        self, angles: np.ndarray, soles: np.ndarray, level: np.ndarray, boost: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(L, n) one bounded Gauss-Newton step, how far off (L,) the tips are, and the squared error (L,).

        Joints that press against a limit rest.
        """
        tips, turns = self._feet_now()
        for (moves, turns_too), tip, foot in zip(self._halves, tips, self._feet, strict=True):
            mujoco.mj_jac(self._model, self._data, moves, turns_too, tip, foot)
        own = self._jacobians.ravel()[self._entries] * self._counts
        error = np.empty((len(tips), 6))
        error[:, :3] = soles[:, :3] - tips
        off = (level @ turns.transpose(0, 2, 1)).reshape(-1, 9)
        error[:, 3:] = self._half_arms * (off[:, _BELOW] - off[:, _ABOVE])
        downhill = (error[:, None] @ own)[:, 0]
        pressed = ((angles <= self._low) & (downhill < 0.0)) | ((angles >= self._high) & (downhill > 0.0))
        if pressed.any():
            own = np.where(pressed[:, None], 0.0, own)
            downhill = np.where(pressed, 0.0, downhill)
        squared = (error * error).sum(axis=1)
        damping = boost * (_DAMPING + _ERROR_DAMPING * squared)
        normal = own.transpose(0, 2, 1) @ own + damping[:, None, None] * self._unit
        step = np.linalg.solve(normal, downhill[:, :, None])[:, :, 0]
        longest = np.abs(step).max(axis=1, keepdims=True)
        if longest.max() > _LONGEST_STEP_RAD:
            step = step * np.minimum(1.0, _LONGEST_STEP_RAD / np.maximum(longest, _LONGEST_STEP_RAD))
        return step, np.sqrt((error[:, :3] ** 2).sum(axis=1)), squared

"""Feet of recorded motions: still where they stand, clear of the floor where they swing."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy import ndimage

from ..behaviours.trajectory import RATE_HZ
from ..model.collision_shapes import colliding, lowest_m
from ..model.model import RobotModel
from ..model.structure import Leg

# A foot stands while it is slower and no higher above the ground than this.
_STANCE_M_S, _STANCE_M = 0.25, 0.03
_SHORTEST_STANCE_S, _LONGEST_GAP_S, _SMOOTHING_S = 0.1, 0.08, 0.04
# In the middle of a swing a foot is at least this high: what skims the floor is caught by it.
_CLEARANCE_M, _CLEARANCE_M_S = 0.05, 0.15
_ITERATIONS, _DAMPING, _TOLERANCE_M = 8, 1e-4, 5e-4
_ARM_M = 0.1  # rotation errors count as metres at this arm
_LIMIT_MARGIN_RAD = 0.005


def stances(place_m: np.ndarray, height_m: np.ndarray, within_m: float = _STANCE_M) -> np.ndarray:
    """(T,) bool: the frames in which a foot at ``place_m`` (T, 3), ``height_m`` (T,) above the
    ground, stands; briefer stances and briefer gaps than a step has do not count."""
    smooth = ndimage.gaussian_filter1d(place_m, _SMOOTHING_S * RATE_HZ, axis=0, mode="nearest")
    speed = np.linalg.norm(np.gradient(smooth, 1.0 / RATE_HZ, axis=0), axis=1)
    stands = (speed < _STANCE_M_S) & (height_m < within_m)
    gap, shortest = (np.ones(round(span * RATE_HZ)) for span in (_LONGEST_GAP_S, _SHORTEST_STANCE_S))
    closed = ndimage.binary_closing(np.pad(stands, len(gap), mode="edge"), gap)[len(gap) : -len(gap)]
    padded = np.pad(closed, len(shortest), mode="edge")
    return ndimage.binary_opening(padded, shortest)[len(shortest) : -len(shortest)]


def planted(foot: np.ndarray, stands: np.ndarray, brisk: bool = False) -> np.ndarray:
    """``foot`` (T, n), whose third column is the height above the ground, held wherever it
    ``stands`` (T,) at the mean of its place and on the ground.

    Between two stances the correction goes over from one to the other, and the foot clears
    the ground; a ``brisk`` swing goes forward while it is high, so that it does not skim.
    """
    frames, found = np.arange(len(foot)), foot.copy()
    at, moves = [], []
    for begin, end in spans(stands):
        place = foot[begin:end].mean(axis=0)
        place[2] = 0.0
        at.append(frames[begin:end])
        moves.append(place - foot[begin:end])
    if at:
        known, correction = np.concatenate(at), np.concatenate(moves)
        for column, values in zip(found.T, correction.T, strict=True):
            column += np.interp(frames, known, values)
    for begin, end in spans(~stands):
        phase = (np.arange(begin, end) - begin + 1.0) / (end - begin + 1.0)
        if brisk and begin > 0 and end < len(foot):
            at = begin - 1.0 + (end - begin + 1.0) * phase**2 * (3.0 - 2.0 * phase)
            swing = found[begin - 1 : end + 1].copy()
            for column in (0, 1):
                found[begin:end, column] = np.interp(at, np.arange(begin - 1, end + 1), swing[:, column])
        clearance_m = min(_CLEARANCE_M, _CLEARANCE_M_S * (end - begin) / RATE_HZ)
        found[begin:end, 2] = np.maximum(found[begin:end, 2], clearance_m * np.sin(np.pi * phase))
    return found


def plant_feet(robot: RobotModel, qpos: np.ndarray) -> np.ndarray:
    """``qpos`` (T, nq) on the floor z = 0 with its feet planted; only the legs' joints change."""
    found = qpos.copy()
    places, heights = foot_places(robot, qpos)
    data = mujoco.MjData(robot.model)
    for leg, place_m, height_m in zip(robot.legs, places, heights, strict=True):
        foot = np.column_stack([place_m[:, :2], height_m])
        moves = planted(foot, stances(place_m[:, :3], height_m)) - foot
        for frame in np.flatnonzero(np.linalg.norm(moves, axis=1) > _TOLERANCE_M):
            _move_foot(robot, data, leg, found[frame], moves[frame])
    return found


def foot_places(robot: RobotModel, qpos: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(L, T, 4) x, y, z of the feet's tips and yaw, as ``LegSolver.solve`` takes them, and (L, T) heights
    of their lowest points, in configurations (T, nq); metres, radians."""
    model, data = robot.model, mujoco.MjData(robot.model)
    geoms = colliding(model)
    of_foot = [geoms[np.isin(model.geom_bodyid[geoms], leg.foot_bodies)] for leg in robot.legs]
    places = np.empty((len(robot.legs), len(qpos), 4))
    heights = np.empty((len(robot.legs), len(qpos)))
    for frame, configuration in enumerate(qpos):
        data.qpos[:] = configuration
        mujoco.mj_kinematics(model, data)
        for index, (leg, own) in enumerate(zip(robot.legs, of_foot, strict=True)):
            forward = data.xmat[leg.foot].reshape(3, 3) @ leg.base_from_foot.T[:, 0]
            places[index, frame, :3] = leg.tip_place(data)
            places[index, frame, 3] = np.arctan2(forward[1], forward[0])
            heights[index, frame] = lowest_m(model, data, own)
    return places, heights


def spans(flags: np.ndarray) -> np.ndarray:
    """(n, 2) int: begin and end of each run of True in ``flags`` (T,)."""
    return np.flatnonzero(np.diff(np.pad(flags.astype(int), 1))).reshape(-1, 2)


def _move_foot(robot: RobotModel, data: mujoco.MjData, leg: Leg, configuration: np.ndarray, move_m: np.ndarray) -> None:
    """Move one foot's tip of ``configuration`` (nq,) by ``move_m`` (3,), turning a flat foot as little as can be."""
    model, joints = robot.model, list(leg.joints)
    address, dof = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
    low, high = model.jnt_range[joints].T + np.array([[_LIMIT_MARGIN_RAD], [-_LIMIT_MARGIN_RAD]])
    jacobian = np.empty((6, model.nv))
    arm_m = _ARM_M if leg.is_flat else 0.0  # a point turns as its place asks
    target = turn = None
    for _ in range(_ITERATIONS):
        data.qpos[:] = configuration
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        matrix = data.xmat[leg.foot].reshape(3, 3)
        tip = leg.tip_place(data)
        if target is None or turn is None:
            target, turn = tip + move_m, matrix.copy()
        error = np.concatenate([target - tip, arm_m * _small_turn(turn @ matrix.T)])
        if np.linalg.norm(error) < _TOLERANCE_M:
            break
        mujoco.mj_jac(model, data, jacobian[:3], jacobian[3:], tip, leg.foot)
        own = jacobian[:, dof] * np.array([1.0, 1.0, 1.0, arm_m, arm_m, arm_m])[:, None]
        step = own.T @ np.linalg.solve(own @ own.T + _DAMPING * np.eye(6), error)
        configuration[address] = np.clip(configuration[address] + step, low, high)


def _small_turn(matrix: np.ndarray) -> np.ndarray:
    """(3,) the rotation vector of a small rotation (3, 3)."""
    return 0.5 * np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])

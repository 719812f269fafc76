"""The posture in which a robot stands: what its file declares, with feet below the body and knees bent."""

from __future__ import annotations

import itertools
import math

import mujoco
import numpy as np

from .collision_shapes import colliding, lowest_m
from .humanoid import REST_POSTURE_RAD
from .kinematics import LegChain
from .structure import Leg, posed

_FREE = int(mujoco.mjtJoint.mjJNT_FREE)
_PARALLEL = 0.8
# A knee nearer to the line from hip to foot, as a share of its length, is straight: the inverse
# kinematics would be singular. Drawing the leg in by a hundredth bends it by 16 degrees.
_STRAIGHT = 0.04
_DRAWN_IN = 0.01
_BEND_RAD = 0.3
# A leg that its limits keep from the declared posture stands below its root, a little bent.
_BENT = 0.95
# A leg whose foot is not this share of its length below its root does not carry the body; it is
# stood up on a foot this far down and out.
_LEAST_DROP, _DROP, _SPREAD, _SPREAD_BEND_RAD = 0.2, 0.45, 0.6, 1.2
_REACHED_M = 1e-3
# A knee bent a little the wrong way soon meets its limit: legs must draw in by this share.
_CROUCH = 0.1
_LIMIT_SLACK_RAD = 0.02


def declared_posture(model: mujoco.MjModel) -> np.ndarray:
    """(nq,) the file's first keyframe, or its zero posture with hanging arms; upright at x = y = 0.

    A keyframe that breaks the joints' limits was not meant to stand in.
    """
    if model.nkey and _keeps_limits(model, model.key_qpos[0]):
        rest = model.key_qpos[0].copy()
    else:
        rest = model.qpos0.copy()
        for name, angle in REST_POSTURE_RAD.items():
            joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
            if joint >= 0:
                rest[model.jnt_qposadr[joint]] = angle
    rest[:2] = 0.0
    rest[3:7] = (1.0, 0.0, 0.0, 0.0)
    return rest


def _keeps_limits(model: mujoco.MjModel, qpos: np.ndarray) -> bool:
    limited = model.jnt_limited.astype(bool) & (model.jnt_type != _FREE)
    angles = qpos[model.jnt_qposadr[limited]]
    low, high = model.jnt_range[limited].T
    return bool((np.maximum(low - angles, angles - high) < _LIMIT_SLACK_RAD).all())


def standing_posture(model: mujoco.MjModel, base: int, legs: tuple[Leg, ...], declared: np.ndarray) -> np.ndarray:
    """(nq,) ``declared`` with its joints inside their limits and legs that carry the body, knees bent.

    What stands already is left as it is. The lowest point of the collision shapes is on z = 0.
    """
    rest = declared.copy()
    limited = model.jnt_limited.astype(bool) & (model.jnt_type != _FREE)
    address = model.jnt_qposadr[limited]
    rest[address] = np.clip(rest[address], *model.jnt_range[limited].T)
    geoms = colliding(model)
    feet = [body for leg in legs for body in leg.foot_bodies]
    others = geoms[~np.isin(model.geom_bodyid[geoms], feet)]
    data = posed(model, rest)
    body_m = lowest_m(model, data, others)
    for leg in legs:
        _stand_leg(model, data, base, leg, declared, rest, body_m)
    rest[2] -= lowest_m(model, posed(model, rest), geoms)
    return rest


def _stand_leg(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    base: int,
    leg: Leg,
    declared: np.ndarray,
    rest: np.ndarray,
    body_m: float,
) -> None:
    """Write one leg's joints into ``rest`` where the posture in ``data`` does not stand on it."""
    hip, knee = _hip_and_knee(data, leg)
    root, joint, foot = data.xanchor[hip], data.xanchor[knee], leg.tip_place(data)
    length_m = float(np.linalg.norm(joint - root) + np.linalg.norm(foot - joint))
    drop_m = root[2] - foot[2]
    address = model.jnt_qposadr[list(leg.joints)]
    place, bend_rad = foot.copy(), _BEND_RAD
    if drop_m < _LEAST_DROP * length_m or foot[2] - leg.sole_m > body_m:
        out = foot[:2] - root[:2]
        if np.linalg.norm(out) < _STRAIGHT * length_m:
            out = np.array([0.0, root[1] - data.xpos[base, 1]])
        place[:2] = root[:2] + _SPREAD * length_m * out / np.linalg.norm(out)
        place[2], bend_rad = root[2] - _DROP * length_m, _SPREAD_BEND_RAD
    elif np.abs(rest[address] - declared[address]).max() > 0.0:
        place[0], place[2] = root[0], root[2] - _BENT * np.linalg.norm((foot - root)[[0, 2]])
    elif _lever_m(data, hip, knee, foot) < _STRAIGHT * length_m or not _can_crouch(
        model, base, leg, rest, place, rest[address]
    ):
        place[2] += _DRAWN_IN * drop_m
    else:
        return
    solutions = _solutions(model, base, leg, rest, place, hip, knee, bend_rad)
    crouching = [joints for joints in solutions if _can_crouch(model, base, leg, rest, place, joints)]
    if solutions:
        rest[address] = max(crouching or solutions, key=lambda joints: _knee_height(model, rest, address, joints, knee))


def _hip_and_knee(data: mujoco.MjData, leg: Leg) -> tuple[int, int]:
    """The two joints, about parallel, with the longest links after each: they change the leg's length."""
    foot = leg.tip_place(data)

    def length_m(pair: tuple[int, int]) -> float:
        hip, knee = pair
        along = abs(float(data.xaxis[hip] @ data.xaxis[knee]))
        links_m = math.dist(data.xanchor[hip], data.xanchor[knee]), math.dist(data.xanchor[knee], foot)
        return along * min(links_m) if along > _PARALLEL else 0.0

    return max(itertools.combinations(leg.joints, 2), key=length_m)


def _lever_m(data: mujoco.MjData, hip: int, knee: int, foot: np.ndarray) -> float:
    """The knee's distance from the line between hip and foot, seen along the hip's axis."""
    axis = data.xaxis[hip]
    across = np.eye(3) - np.outer(axis, axis)
    to_knee, to_foot = across @ (data.xanchor[knee] - data.xanchor[hip]), across @ (foot - data.xanchor[hip])
    return float(np.linalg.norm(np.cross(to_knee, to_foot)) / max(float(np.linalg.norm(to_foot)), 1e-9))


def _solutions(
    model: mujoco.MjModel,
    base: int,
    leg: Leg,
    rest: np.ndarray,
    place: np.ndarray,
    hip: int,
    knee: int,
    bend_rad: float,
) -> list[np.ndarray]:
    """The leg's joints that reach ``place`` (3,), the knee bent either way, inside their limits."""
    chain = LegChain(model, base, leg)
    seeds = np.tile(rest[chain.address], (2, 1))
    data = posed(model, rest)
    same = np.sign(data.xaxis[hip] @ data.xaxis[knee])
    seeds[:, leg.joints.index(knee)] += (bend_rad, -bend_rad)
    seeds[:, leg.joints.index(hip)] -= 0.5 * same * np.array([bend_rad, -bend_rad])
    joints, missed_m = chain.solve(np.tile(rest, (2, 1)), np.tile([*place, 0.0], (2, 1)), seeds)
    return [solution for solution, missed in zip(joints, missed_m, strict=True) if missed < _REACHED_M]


def _can_crouch(
    model: mujoco.MjModel, base: int, leg: Leg, rest: np.ndarray, place: np.ndarray, joints: np.ndarray
) -> bool:
    """Whether the leg can draw its foot up from ``place`` without bending its knee the other way."""
    chain = LegChain(model, base, leg)
    up_m = _CROUCH * (rest[2] - place[2])
    _, missed_m = chain.solve(rest[None], np.array([[*place[:2], place[2] + up_m, 0.0]]), joints[None])
    return bool(missed_m[0] < _REACHED_M)


def _knee_height(model: mujoco.MjModel, rest: np.ndarray, address: np.ndarray, joints: np.ndarray, knee: int) -> float:
    """How far up and ahead the knee is: a person's points ahead, an insect's up."""
    qpos = rest.copy()
    qpos[address] = joints
    anchor = posed(model, qpos).xanchor[knee]
    return float(anchor[2] + anchor[0])

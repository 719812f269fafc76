"""A human's motion on a robot: body directions by differential inverse kinematics (mink).

Directions of limbs carry over, positions do not: the robot's own limbs are laid along the
human's, its feet are kept where they stand, and its base is carried by its legs. Distances
along the floor scale by the legs' lengths.
"""

from __future__ import annotations

from dataclasses import dataclass

import mink
import mujoco
import numpy as np
from scipy import ndimage
from scipy.spatial.transform import Rotation, Slerp

from ...core.errors import RobotError
from ..behaviours.trajectory import RATE_HZ
from ..model.model import RobotModel
from ..model.structure import Leg, ancestors, fixed_to, is_hinge, joints_of
from .foot_locking import planted, stances
from .recorded_motion import HUMAN_BODIES, HumanRecording, frame_count

_BODY = {name: index for index, name in enumerate(HUMAN_BODIES)}
_SIDES = ("left", "right")
_BONES = (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))
_SHORTEST_M = 1e-3  # of a bone that has a direction
# A foot that stands has its ankle no higher above its lowest than this.
_STANCE_M = 0.05
_SMOOTHING_S = 0.04
# Costs of the tasks: metres, radians and unit vectors weigh alike.
_FOOT_COST, _BASE_COST, _TURN_COST, _LIMB_COST, _POSTURE_COST = 20.0, 2.0, 1.0, 1.0, 0.02
# Where a foot points matters less than where its leg lies.
_FOOT_YAW_COST = 0.5
_DAMPING, _LIMIT_MARGIN_RAD = 1e-3, 0.02
_FIRST_ITERATIONS, _ITERATIONS = 60, 4
# Hips and shoulders have several hinges: a limb begins at the last that is as far, as a share of
# the farthest, from its knee or elbow.
_PROXIMAL = 0.8
_ALONG = 0.7
# A leg with fewer hinges cannot turn its foot in every way.
_EVERY_WAY_HINGES = 6


@dataclass(frozen=True)
class Segment:
    """A robot's limb and the human's: ``axis`` (3,) in the body's frame lies along the human's bones."""

    name: str
    body: str
    axis: np.ndarray
    human_from: int
    human_to: int


@dataclass(frozen=True)
class _Chain:
    """A leg as two straight links from the base, metres, in the base's frame at qpos0."""

    leg: Leg
    hip_m: np.ndarray
    thigh_m: float
    shin_m: float
    foot_m: np.ndarray


def retarget(human: HumanRecording, robot: RobotModel) -> np.ndarray:
    """(T, nq) float64 at ``RATE_HZ``: the motion of ``human`` on ``robot``, its soles on z = 0.

    Joint limits are kept; feet that stand do not move. Raises RobotError for a robot that is
    no biped with knees, and for a human whose limbs have no length.
    """
    if len(robot.legs) != 2:
        raise RobotError(f"the robot has {len(robot.legs)} legs", where=human.where, cure="A human's motion needs two.")
    position, rotation = _resampled(human)
    _refuse_points(human.where, position)
    chains = [_leg_chain(robot, leg) for leg in robot.legs]
    human_leg_m = np.mean([_bone_m(position, f"{side}_hip", f"{side}_knee", f"{side}_ankle") for side in _SIDES])
    scale = float(np.mean([chain.thigh_m + chain.shin_m for chain in chains])) / human_leg_m
    base = np.tile(np.eye(4), (len(position), 1, 1))
    base[:, :3, :3] = rotation[:, _BODY["pelvis"]]
    base[:, :2, 3] = scale * (position[:, 0, :2] - position[0, 0, :2])
    feet = np.stack([_chain_foot(chain, side, base, position) for chain, side in zip(chains, _SIDES, strict=True)])
    # The base is as high as the lower foot's leg carries it.
    sole_m = np.array([leg.origin_m for leg in robot.legs])
    below = (feet[..., 2] - sole_m[:, None]).min(axis=0)
    base[:, 2, 3] = -ndimage.gaussian_filter1d(below, _SMOOTHING_S * RATE_HZ, mode="nearest")
    feet[..., 2] += base[:, 2, 3]
    yaws = [np.unwrap(_heading(rotation[:, _BODY[f"{side}_ankle"]])) for side in _SIDES]
    for foot, yaw, leg, side in zip(feet, yaws, robot.legs, _SIDES, strict=True):
        place = np.column_stack([foot - [0.0, 0.0, leg.origin_m], yaw])
        place = planted(place, standing(position[:, _BODY[f"{side}_ankle"]]), brisk=True)
        foot[:], yaw[:] = place[:, :3] + [0.0, 0.0, leg.origin_m], place[:, 3]
    return _solve(robot, base, rotation[:, _BODY["chest"]], feet, yaws, position, human.where)


def segments(robot: RobotModel) -> tuple[Segment, ...]:
    """The limbs of a biped that have a human's directions: thighs, shins, arms where it has them."""
    found = []
    for side, leg in zip(_SIDES, robot.legs, strict=False):
        found += _limb(robot, list(leg.joints), side, ("thigh", "hip", "knee"), ("shin", "knee", "ankle"))
    for side, shoulder in zip(_SIDES, robot.shoulders, strict=False):
        arm = _arm_joints(robot.model, shoulder)
        found += _limb(robot, arm, side, ("upper arm", "shoulder", "elbow"), ("forearm", "elbow", "wrist"))
    return tuple(found)


def standing(ankle_m: np.ndarray) -> np.ndarray:
    """(T,) bool: the frames in which a human's ankle (T, 3) rests on the floor."""
    height = ndimage.gaussian_filter1d(ankle_m[:, 2], _SMOOTHING_S * RATE_HZ, mode="nearest")
    return stances(ankle_m, height - np.quantile(height, 0.05), _STANCE_M)


def _resampled(human: HumanRecording) -> tuple[np.ndarray, np.ndarray]:
    """Positions (T, 24, 3) and rotations (T, 24, 3, 3) at ``RATE_HZ``."""
    times = np.arange(len(human.position_m)) / human.rate_hz
    at = np.minimum(np.arange(frame_count(times[-1])) / RATE_HZ, times[-1])
    flat = human.position_m.reshape(len(times), -1)
    position = np.stack([np.interp(at, times, column) for column in flat.T], axis=1).reshape(len(at), -1, 3)
    rotation = np.empty((*position.shape[:2], 3, 3))
    for body in range(position.shape[1]):
        rotation[:, body] = Slerp(times, Rotation.from_matrix(human.rotation[:, body]))(at).as_matrix()
    return position, rotation


def _chain_foot(chain: _Chain, side: str, base: np.ndarray, position: np.ndarray) -> np.ndarray:
    """(T, 3) where the robot's foot body is when its leg lies along the human's."""
    hip, knee, ankle = (position[:, _BODY[f"{side}_{name}"]] for name in ("hip", "knee", "ankle"))
    knee_m = base[:, :3, 3] + base[:, :3, :3] @ chain.hip_m + chain.thigh_m * _directions(hip, knee)
    # The foot stays level: what is below the ankle is there in the world, too.
    return knee_m + chain.shin_m * _directions(knee, ankle) + chain.foot_m


def _solve(
    robot: RobotModel,
    base: np.ndarray,
    chest: np.ndarray,
    feet: np.ndarray,
    yaws: list[np.ndarray],
    position: np.ndarray,
    where: str,
) -> np.ndarray:
    """(T, nq): each frame's inverse kinematics, begun from the frame before."""
    model = robot.model
    parts = segments(robot)
    limbs = [mink.AxisAlignTask(part.body, "body", part.axis, _LIMB_COST) for part in parts]
    directions = [_directions(position[:, part.human_from], position[:, part.human_to]) for part in parts]
    on_base = mink.FrameTask(model.body(robot.base).name, "body", _BASE_COST, _TURN_COST)
    on_feet = [_foot_task(model, leg) for leg in robot.legs]
    posture = mink.PostureTask(model, _POSTURE_COST)
    posture.set_target(robot.rest_qpos)
    tasks: list[mink.Task] = [on_base, *on_feet, *limbs, posture]
    torso = _torso(robot)
    on_torso = mink.FrameTask(torso or on_base.frame_name, "body", 0.0, _TURN_COST if torso else 0.0)
    tasks.append(on_torso)
    limits = [mink.ConfigurationLimit(model, min_distance_from_limits=_LIMIT_MARGIN_RAD)]
    configuration = mink.Configuration(model, robot.rest_qpos)
    qpos = np.empty((len(base), model.nq))
    for frame in range(len(base)):
        on_base.set_target(mink.SE3.from_matrix(base[frame]))
        on_torso.set_target(mink.SE3.from_rotation(mink.SO3.from_matrix(chest[frame])))
        for task, foot, yaw, leg in zip(on_feet, feet, yaws, robot.legs, strict=True):
            turn = Rotation.from_euler("z", yaw[frame]).as_matrix() @ leg.base_from_foot
            target = np.eye(4)
            target[:3, :3], target[:3, 3] = turn, foot[frame]
            task.set_target(mink.SE3.from_matrix(target))
        for limb, direction in zip(limbs, directions, strict=True):
            limb.set_target(direction[frame])
        if frame == 0:
            start = robot.rest_qpos.copy()
            start[:3] = base[0, :3, 3]
            start[3:7] = Rotation.from_matrix(base[0, :3, :3]).as_quat(scalar_first=True)
            configuration.update(start)
        for _ in range(_ITERATIONS if frame else _FIRST_ITERATIONS):
            try:
                velocity = mink.solve_ik(configuration, tasks, 1.0, "daqp", damping=_DAMPING, limits=limits)
            except mink.MinkError as error:
                raise RobotError(
                    f"the motion cannot be retargeted at frame {frame}", where=where, cure="Cut it there."
                ) from error
            configuration.integrate_inplace(velocity, 1.0)
        qpos[frame] = configuration.q
    return qpos


def _foot_task(model: mujoco.MjModel, leg: Leg) -> mink.FrameTask:
    """Keeps a foot in its place and level."""
    level = _FOOT_COST if len(leg.joints) >= _EVERY_WAY_HINGES else _TURN_COST
    up = np.abs(leg.base_from_foot[2])  # the vertical in the foot's own axes
    turn = up * _FOOT_YAW_COST + (1.0 - up) * level
    return mink.FrameTask(model.body(leg.foot).name, "body", _FOOT_COST, turn)


def _leg_chain(robot: RobotModel, leg: Leg) -> _Chain:
    data = mujoco.MjData(robot.model)
    mujoco.mj_kinematics(robot.model, data)
    joints = list(leg.joints)
    knee = _middle(data, joints)
    if knee is None or knee + 1 >= len(joints):
        raise RobotError("a leg of the robot has no knee", where=robot.source, cure="Give a humanoid.")
    anchors = data.xanchor[joints]
    hip, ankle = anchors[_proximal(anchors[: knee + 1])], anchors[knee + 1]
    return _Chain(
        leg,
        data.xmat[robot.base].reshape(3, 3).T @ (hip - data.xpos[robot.base]),
        float(np.linalg.norm(anchors[knee] - hip)),
        float(np.linalg.norm(ankle - anchors[knee])),
        data.xpos[leg.foot] - ankle,
    )


def _limb(
    robot: RobotModel, joints: list[int], side: str, upper: tuple[str, str, str], lower: tuple[str, str, str]
) -> list[Segment]:
    """The upper and lower half of a limb; none where it has no joint between them."""
    model, data = robot.model, mujoco.MjData(robot.model)
    mujoco.mj_kinematics(model, data)
    middle = _middle(data, joints)
    if middle is None:
        return []
    anchors = data.xanchor[joints]
    ends = [anchors[middle], data.xipos[model.jnt_bodyid[joints[-1]]]]
    if middle + 1 < len(joints):
        ends[1] = anchors[middle + 1]
    starts = [anchors[_proximal(anchors[: middle + 1])], anchors[middle]]
    bodies = model.jnt_bodyid[[joints[middle - 1], joints[middle]]]
    return [
        Segment(
            f"{side} {name}",
            model.body(body).name,
            data.xmat[body].reshape(3, 3).T @ (end - start),
            _BODY[f"{side}_{human_from}"],
            _BODY[f"{side}_{human_to}"],
        )
        for (name, human_from, human_to), body, start, end in zip((upper, lower), bodies, starts, ends, strict=True)
    ]


def _middle(data: mujoco.MjData, joints: list[int]) -> int | None:
    """Which of a limb's hinges is its knee or elbow: the second that turns across the robot."""
    across = [index for index, joint in enumerate(joints) if abs(data.xaxis[joint, 1]) > _ALONG]
    return across[1] if len(across) > 1 else None


def _proximal(anchors: np.ndarray) -> int:
    """Where a limb begins: the hinges (n, 3) of a hip or shoulder, the knee or elbow last."""
    away = np.linalg.norm(anchors[:-1] - anchors[-1], axis=1)
    return int(np.flatnonzero(away >= _PROXIMAL * away.max())[-1])


def _arm_joints(model: mujoco.MjModel, shoulder: int) -> list[int]:
    """The hinges from ``shoulder`` on, along the longest chain of bodies below it."""
    body = int(model.jnt_bodyid[shoulder])
    below = [end for end in range(body, model.nbody) if body in ancestors(model, end)]
    chains = [
        [
            joint
            for link in ancestors(model, end)
            if link >= body
            for joint in joints_of(model, link)
            if is_hinge(model, joint)
        ]
        for end in below
    ]
    return max(chains, key=len)


def _torso(robot: RobotModel) -> str | None:
    """The body that carries the arms or the camera, where joints move it against the base."""
    model = robot.model
    if robot.shoulders:
        body = int(model.body_parentid[model.jnt_bodyid[robot.shoulders[0]]])
    else:
        body = model.body(robot.mount.parent).id
    return None if body in fixed_to(model, robot.base) else model.body(body).name


def _bone_m(position: np.ndarray, *names: str) -> float:
    joints = position[:, [_BODY[name] for name in names]]
    return float(np.linalg.norm(np.diff(joints, axis=1), axis=2).sum(axis=1).mean())


def _refuse_points(where: str, position: np.ndarray) -> None:
    """Raises RobotError where a limb's bone in ``position`` (T, 24, 3) points nowhere."""
    for side in _SIDES:
        for upper, lower in _BONES:
            start, end = f"{side}_{upper}", f"{side}_{lower}"
            bone = position[:, _BODY[end]] - position[:, _BODY[start]]
            if np.linalg.norm(bone, axis=1).min() < _SHORTEST_M:
                raise RobotError(f"{start} and {end} are in one place", where=where, cure="Give a human's bodies.")


def _directions(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """(T, 3) unit vectors from ``start`` (T, 3) to ``end`` (T, 3)."""
    bone = end - start
    return bone / np.maximum(np.linalg.norm(bone, axis=1, keepdims=True), 1e-9)


def _heading(rotation: np.ndarray) -> np.ndarray:
    """(T,) radians: where the x axes of (T, 3, 3) point along the floor."""
    return np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])

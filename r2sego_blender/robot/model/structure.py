"""What a robot's kinematic tree says about its body: legs and feet, wheels, shoulders."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import zip_longest

import mujoco
import numpy as np

from .collision_shapes import bearing_points, colliding, farthest_point, is_round_about, lowest_m

_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
_ON_JOINT = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
# A leg has this many hinges of its own at least; from this many on its sole can be kept level.
_LEG_HINGES, _LEVEL_HINGES = 3, 5
# Feet reach down to the lowest foot, and wheels to the robot's lowest point, within this.
_GROUND_M = 0.04
# The points of a foot this close to its lowest one carry it.
_SOLE_THICKNESS_M = 0.01
# Forces are planned within this share of a sole, away from its edges.
_SOLE_SHARE = 0.7
# A hinge that turns farther than this can roll.
_WIDE_TURN_RAD = 4.0 * np.pi
_ALONG = 0.9


@dataclass(frozen=True)
class Leg:
    """One leg: the foot's body and the joints from the base to it, top first.

    Legs of a ``group`` (0 or 1) swing together. A foot that ``is_flat`` is kept level;
    another is a point, and only its place is given. ``tip`` (3,) is the point of the foot,
    in its own frame, that is placed: a flat foot's origin, a point foot's end. At rest
    ``base_from_foot`` (3, 3) turns the foot's axes into the base's, and the tip is ``sole_m``
    above the sole, which reaches from ``sole_low_m`` to ``sole_high_m`` (2,) around the tip
    in the base's x and y, less a margin. ``foot_bodies``: the foot and what is fixed to it.
    """

    foot: int
    joints: tuple[int, ...]
    group: int
    is_flat: bool
    tip: np.ndarray
    sole_m: float
    sole_low_m: np.ndarray
    sole_high_m: np.ndarray
    base_from_foot: np.ndarray
    foot_bodies: tuple[int, ...]

    @property
    def origin_m(self) -> float:
        """How high at rest the origin of the foot's body is above the sole: a point foot's is at its knee."""
        return self.sole_m - float((self.base_from_foot @ self.tip)[2])

    def tip_place(self, data: mujoco.MjData) -> np.ndarray:
        """(3,) where the tip is in the world, in ``data`` with its kinematics done."""
        return data.xpos[self.foot] + data.xmat[self.foot].reshape(3, 3) @ self.tip


@dataclass(frozen=True)
class Wheel:
    """A driven wheel, ``offset_m`` (2,) beside the base's origin at rest, in the base's x and y.

    ``forward`` is 1.0 where a growing angle rolls the robot ahead, else -1.0.
    """

    joint: int
    radius_m: float
    offset_m: np.ndarray
    forward: float


def find_wheels(model: mujoco.MjModel, base: int, rest_qpos: np.ndarray) -> tuple[Wheel, ...]:
    """Endless hinges across the base whose round shapes touch the ground; left to right.

    Where the file has actuators only driven hinges count: the others are casters.
    """
    data = posed(model, rest_qpos)
    found = [_wheel(model, data, base, joint) for joint in range(model.njnt)]
    return tuple(sorted((one for one in found if isinstance(one, Wheel)), key=lambda wheel: -wheel.offset_m[1]))


def no_wheels(model: mujoco.MjModel, base: int, rest_qpos: np.ndarray) -> dict[str, str]:
    """By the joint's name, what keeps an endless hinge, or one that is called a wheel, from being one."""
    data = posed(model, rest_qpos)
    found = {model.joint(joint).name: _wheel(model, data, base, joint) for joint in range(model.njnt)}
    return {name: why for name, why in found.items() if isinstance(why, str) and why}


def _wheel(model: mujoco.MjModel, data: mujoco.MjData, base: int, joint: int) -> Wheel | str:
    """The wheel on ``joint`` in ``data``, or why it is none; '' where nothing looks like one."""
    low, high = model.jnt_range[joint]
    is_endless = not model.jnt_limited[joint] or high - low > _WIDE_TURN_RAD
    axis, anchor = data.xaxis[joint], data.xanchor[joint]
    if not is_hinge(model, joint) or not (is_endless or "wheel" in model.joint(joint).name.lower()):
        return ""
    if not is_endless:
        return "its range is limited"
    if abs(axis[1]) <= _ALONG:
        return "its axis does not lie across the base"
    if model.nu and joint not in model.actuator_trnid[on_joints(model), 0]:
        return "no actuator drives it"
    geoms = _geoms_of(model, fixed_to(model, int(model.jnt_bodyid[joint])))
    if not len(geoms):
        return "it has no collision shape"
    bottom, ground = lowest_m(model, data, geoms), lowest_m(model, data, colliding(model))
    if bottom >= ground + _GROUND_M:
        return f"it hangs {bottom - ground:.2f} m above the lowest shape"
    if not is_round_about(model, data, geoms, anchor, axis):
        return "its collision shape is not round about the axis"
    return Wheel(joint, float(anchor[2] - bottom), (anchor - data.xpos[base])[:2], float(np.sign(axis[1])))


def find_legs(model: mujoco.MjModel, base: int, rest_qpos: np.ndarray) -> tuple[Leg, ...]:
    """The limbs of three hinges or more whose ends reach lowest at rest.

    Front to back, left before right; diagonal neighbours share a group, so that a biped
    alternates, a quadruped trots and a hexapod goes on tripods.
    """
    data = posed(model, rest_qpos)
    limbs = [joints for joints in _limbs(model, base) if len(joints) >= _LEG_HINGES]
    feet = [int(model.jnt_bodyid[joints[-1]]) for joints in limbs]
    bottoms = [lowest_m(model, data, _geoms_of(model, fixed_to(model, foot))) for foot in feet]
    standing = [
        (foot, joints)
        for foot, joints, bottom in zip(feet, limbs, bottoms, strict=True)
        if bottom < min(bottoms) + _GROUND_M
    ]
    # Feet side by side count as one row even where they are not quite level with each other.
    places = {foot: data.xpos[foot] - data.xpos[base] for foot, _ in standing}
    standing.sort(key=lambda leg: -places[leg[0]][0])
    sides = [[leg for leg in standing if (places[leg[0]][1] >= 0.0) == left] for left in (True, False)]
    return tuple(
        _leg(model, data, base, foot=leg[0], joints=leg[1], group=(row + side) % 2)
        for row, pair in enumerate(zip_longest(*sides))
        for side, leg in enumerate(pair)
        if leg is not None
    )


def standing_leg(model: mujoco.MjModel, base: int, leg: Leg, rest_qpos: np.ndarray) -> Leg:
    """``leg`` as it stands in ``rest_qpos`` (nq,)."""
    return _leg(model, posed(model, rest_qpos), base, leg.foot, leg.joints, leg.group)


def find_shoulders(model: mujoco.MjModel, others: set[int]) -> tuple[int, ...]:
    """The first sideways hinge of each limb that is not among ``others``, left then right."""
    data = posed(model, model.qpos0)
    found: list[int] = []
    for joint in range(model.njnt):
        moved = set(ancestors(model, int(model.jnt_bodyid[joint])))
        beyond = any(model.jnt_bodyid[other] in moved for other in found)
        if joint in others or beyond or not is_hinge(model, joint):
            continue
        if abs(data.xaxis[joint, 1]) > _ALONG:
            found.append(joint)
    return tuple(sorted(found[:2], key=lambda joint: -data.xanchor[joint, 1]))


def posed(model: mujoco.MjModel, qpos: np.ndarray) -> mujoco.MjData:
    """New data with the kinematics of ``qpos`` (nq,)."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    return data


def ancestors(model: mujoco.MjModel, body: int) -> Iterator[int]:
    """``body`` and the bodies above it, from the top one down; not the world."""
    chain = []
    while body != 0:
        chain.append(int(body))
        body = model.body_parentid[body]
    return reversed(chain)


def fixed_to(model: mujoco.MjModel, body: int) -> tuple[int, ...]:
    """``body`` and the bodies below it that no joint moves against it."""
    found = [body]
    for other in range(body + 1, model.nbody):
        if model.body_parentid[other] in found and model.body_jntnum[other] == 0:
            found.append(other)
    return tuple(found)


def joints_of(model: mujoco.MjModel, body: int) -> range:
    """The body's own joints."""
    start = int(model.body_jntadr[body])
    return range(start, start + int(model.body_jntnum[body])) if start >= 0 else range(0)


def is_hinge(model: mujoco.MjModel, joint: int) -> bool:
    """Whether ``joint`` is a hinge."""
    return bool(model.jnt_type[joint] == _HINGE)


def on_joints(model: mujoco.MjModel) -> np.ndarray:
    """(nu,) bool which actuators drive a joint: their first ``trnid`` is its id, and not a tendon's."""
    return np.isin(model.actuator_trntype, _ON_JOINT)


def axes_in_base(data: mujoco.MjData, base: int) -> np.ndarray:
    """(njnt, 3) the joints' axes in the base's frame, in ``data`` with its kinematics done."""
    return data.xaxis @ data.xmat[base].reshape(3, 3)


def first_about(axes: np.ndarray, joints: Iterable[int], axis: int) -> int | None:
    """The first of ``joints`` whose axis, of ``axes`` (njnt, 3), lies along ``axis`` or against it."""
    return next((joint for joint in joints if abs(axes[joint, axis]) > _ALONG), None)


def _limbs(model: mujoco.MjModel, base: int) -> list[tuple[int, ...]]:
    """The hinges, top first, that each of the tree's longest chains of hinges has for itself."""
    found = {
        tuple(joint for body in ancestors(model, end) for joint in joints_of(model, body) if is_hinge(model, joint))
        for end in range(base + 1, model.nbody)
    }
    chains = sorted(chain for chain in found if not any(_begins(other, chain) for other in found))
    uses = np.bincount([joint for chain in chains for joint in chain], minlength=model.njnt)
    return [tuple(joint for joint in chain if uses[joint] == 1) for chain in chains]


def _begins(longer: tuple[int, ...], chain: tuple[int, ...]) -> bool:
    return len(longer) > len(chain) and longer[: len(chain)] == chain


def _leg(model: mujoco.MjModel, data: mujoco.MjData, base: int, foot: int, joints: tuple[int, ...], group: int) -> Leg:
    bodies = fixed_to(model, foot)
    geoms = _geoms_of(model, bodies)
    is_flat = len(joints) >= _LEVEL_HINGES
    turn, tip, low, high = data.xmat[foot].reshape(3, 3), np.zeros(3), np.zeros(2), np.zeros(2)
    if is_flat:
        around = bearing_points(model, data, geoms, _SOLE_THICKNESS_M) - data.xpos[foot, :2]
        low, high = around.min(axis=0), around.max(axis=0)
    else:
        end = farthest_point(model, data, geoms, data.xanchor[joints[-1]], _SOLE_THICKNESS_M)
        tip = turn.T @ (end - data.xpos[foot])
    middle, half = (high + low) / 2.0, _SOLE_SHARE * (high - low) / 2.0
    return Leg(
        foot=foot,
        joints=joints,
        group=group,
        is_flat=is_flat,
        tip=tip,
        sole_m=float((data.xpos[foot] + turn @ tip)[2]) - lowest_m(model, data, geoms),
        sole_low_m=middle - half,
        sole_high_m=middle + half,
        base_from_foot=data.xmat[base].reshape(3, 3).T @ turn,
        foot_bodies=bodies,
    )


def _geoms_of(model: mujoco.MjModel, bodies: tuple[int, ...]) -> np.ndarray:
    geoms = colliding(model)
    return geoms[np.isin(model.geom_bodyid[geoms], bodies)]

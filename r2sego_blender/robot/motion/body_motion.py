"""Recorded bodies beside recorded joints: they say where the base is, and in which order the joints are.

Isaac Lab orders joints breadth first, MuJoCo depth first, and files of one layout come in both. The forward
kinematics of the right order meets the bodies that were recorded; a wrong one's does not.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from ..model.model import RobotModel
from .motion_fields import motion_error

# A robot's bodies lie within this of those recorded of it, or of a like one; half of them at least.
_MEETS_M = 0.05
# The right order is nearer than any other by this.
_CLEARLY_M = 0.003
_LOOKED_AT = 32


@dataclass(frozen=True)
class RecordedBodies:
    """Bodies in the world: ``position_m`` (T, B, 3), ``quaternion`` (T, B, 4) or None where their
    rotations were not recorded, ``names`` (B) or none; without names the first is the base."""

    position_m: np.ndarray
    quaternion: np.ndarray | None
    names: tuple[str, ...]

    def base(self, robot: RobotModel) -> int:
        """Which of them is the robot's base."""
        name = robot.model.body(robot.base).name
        return self.names.index(name) if name in self.names else 0


def explained(
    where: str,
    bodies: RecordedBodies,
    joints: np.ndarray,
    orders: Sequence[tuple[str, ...]],
    readings: Sequence[np.ndarray],
    robot: RobotModel,
) -> tuple[tuple[str, ...], np.ndarray]:
    """The names of ``joints`` (T, n) among ``orders``, and the base's quaternion (T, 4) wxyz among
    ``readings``, with which the robot's forward kinematics meets ``bodies``.

    Raises RobotError where none does, or two orders do.
    """
    frames = np.unique(np.linspace(0, len(joints) - 1, _LOOKED_AT).astype(int))
    relative = bodies.position_m[frames] - bodies.position_m[frames, None, bodies.base(robot)]
    seen = [Rotation.from_quat(one[frames], scalar_first=True).inv().as_matrix() for one in readings]
    tried = []
    for names in orders:
        places = _in_base(robot, names, joints[frames])
        for reading, into_base in zip(readings, seen, strict=True):
            away = np.einsum("tij,tbj->tbi", into_base, relative)[:, :, None] - places[:, None]
            misses = np.sqrt((away**2).sum(axis=-1).mean(axis=0)).min(axis=1)
            misses = np.delete(misses, bodies.base(robot))
            tried.append((float(misses.sum()) / max(len(misses), 1), names, reading, misses))
    missed_m, names, reading, misses = min(tried, key=lambda one: one[0])
    cure = "Say the order: name the joints in joint_names, and give root_pos and root_quat."
    if any(other[1] != names and other[0] < missed_m + _CLEARLY_M for other in tried):
        raise motion_error(where, "its joints have no names, and its bodies do not tell their order", cure)
    if len(misses) and float(np.median(misses)) > _MEETS_M:
        what = f"its bodies lie {np.median(misses):.2f} m from where its joints have the robot's"
        raise motion_error(where, what, f"Give a motion of this robot. {cure}")
    return names, reading


def joint_orders(robot: RobotModel) -> list[tuple[str, ...]]:
    """The names of the robot's joints in its own order and, where it is another, breadth first."""
    model = robot.model
    own = [joint for joint in range(model.njnt) if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_FREE]
    after: dict[int, list[int]] = defaultdict(list)
    last: dict[int, int] = {}  # of each body, the joint that moves it
    for joint in own:
        body = int(model.jnt_bodyid[joint])
        above = body if body in last else int(model.body_parentid[body])
        while above not in last and above != 0:
            above = int(model.body_parentid[above])
        after[last.get(above, -1)].append(joint)
        last[body] = joint
    level, breadth_first = after[-1], list[int]()
    while level:
        breadth_first += level
        level = [joint for above in level for joint in after[above]]
    names = [tuple(model.joint(joint).name for joint in order) for order in (own, breadth_first)]
    return list(dict.fromkeys(names))


def _in_base(robot: RobotModel, names: tuple[str, ...], joints: np.ndarray) -> np.ndarray:
    """(T, bodies, 3) where the robot's bodies are in its base's frame, with the angles (T, n) of ``names``."""
    model, data = robot.model, mujoco.MjData(robot.model)
    address = [int(model.joint(name).qposadr[0]) for name in names]
    places = np.empty((len(joints), model.nbody - 1, 3))
    for place, angles in zip(places, joints, strict=True):
        data.qpos[:] = robot.rest_qpos
        data.qpos[:7] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
        data.qpos[address] = angles
        mujoco.mj_kinematics(model, data)
        place[:] = data.xpos[1:]
    return places

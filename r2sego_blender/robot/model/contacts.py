"""What the robot touches of the scene at one moment of the simulation."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from .composition import Composition

SEATED_LOAD = 0.3
"""Who sits has more than this share of the weight on a seat."""


@dataclass(frozen=True)
class Contacts:
    """n contacts of the robot with the scene.

    ``robot`` and ``scene`` (n,) int, the geoms; ``depth_m`` (n,) float64, how deep they have
    sunk into each other; ``position_m`` (n, 3) float64; ``level`` (n,) float64, the cosine
    between the contact's normal and the vertical; ``force_n`` (n,) float64 along the normal.
    """

    robot: np.ndarray
    scene: np.ndarray
    depth_m: np.ndarray
    position_m: np.ndarray
    level: np.ndarray
    force_n: np.ndarray


def scene_contacts(composition: Composition, data: mujoco.MjData, with_forces: bool = True) -> Contacts:
    """The contacts in ``data``; those that only come near have no depth and are left out.

    Without forces, which a simulation step has to have computed, they are zero.
    """
    contact = data.contact
    touching = np.flatnonzero(contact.dist < 0.0) if data.ncon else np.empty(0, int)
    pairs = contact.geom[touching].reshape(-1, 2)
    scene_first = composition.scene_geoms[pairs[:, 0]]
    wrench = np.zeros(6)
    force_n = np.zeros(len(touching))
    for index, one in enumerate(touching if with_forces else ()):
        mujoco.mj_contactForce(composition.model, data, int(one), wrench)
        force_n[index] = wrench[0]
    return Contacts(
        robot=np.where(scene_first, pairs[:, 1], pairs[:, 0]),
        scene=np.where(scene_first, pairs[:, 0], pairs[:, 1]),
        depth_m=-contact.dist[touching],
        position_m=contact.pos[touching].reshape(-1, 3),
        level=np.abs(contact.frame[touching].reshape(-1, 9)[:, 2]),
        force_n=force_n,
    )

"""Separately authored chairs: boxes to sit on that are no part of the room's splats."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import mujoco
import numpy as np
import trimesh

from ...robot.rollouts.bodies import BodyShape

_Box = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Opposite corners."""

_ABOVE_M = 50.0  # where chairs wait that stand in no episode: over the room, where nothing comes


@dataclass(frozen=True)
class Chair:
    """A chair of boxes, with legs and, where ``back_m`` is above 0, a backrest that rises so far above the seat.

    Its frame lies on the floor under the middle of the seat's front edge, x ahead of who sits on it.
    """

    width_m: float
    depth_m: float
    height_m: float
    back_m: float
    colour: tuple[float, float, float]

    @property
    def boxes(self) -> tuple[_Box, ...]:
        """The seat, its legs, and its backrest."""
        half, depth, height, thick, leg = self.width_m / 2.0, self.depth_m, self.height_m, 0.04, 0.035
        found: list[_Box] = [((-depth, -half, height - thick), (0.0, half, height))]
        for x in (-depth, -leg - 0.02):
            for y in (-half, half - leg):
                found.append(((x, y, 0.0), (x + leg, y + leg, height - thick)))
        if self.back_m > 0.0:
            found.append(((-depth, -half, height), (-depth + thick, half, height + self.back_m)))
        return tuple(found)

    def shape(self) -> BodyShape:
        """Its look."""
        parts = [trimesh.creation.box(bounds=box) for box in self.boxes]
        vertices = np.concatenate([part.vertices for part in parts]).astype(np.float32)
        faces = np.concatenate([part.faces + 8 * index for index, part in enumerate(parts)]).astype(np.int32)
        colours = np.tile(np.array(self.colour, np.float32), (len(faces), 1))
        return BodyShape(-1, "chair", vertices, faces, colours)


CHAIRS: Mapping[str, Chair] = MappingProxyType(
    {
        "dining": Chair(0.44, 0.42, 0.46, 0.45, (0.55, 0.36, 0.2)),
        "office": Chair(0.48, 0.45, 0.42, 0.5, (0.15, 0.16, 0.2)),
        "stool": Chair(0.4, 0.4, 0.5, 0.0, (0.8, 0.75, 0.65)),
        "low": Chair(0.55, 0.5, 0.36, 0.4, (0.2, 0.4, 0.55)),
        "bench": Chair(0.9, 0.4, 0.44, 0.0, (0.35, 0.5, 0.3)),
    }
)
"""The kinds by name: of several heights, with and without backs."""


def add_chairs(spec: mujoco.MjSpec, names: Sequence[str]) -> None:
    """One body for each of the kinds to a scene, over the room for now."""
    for index, name in enumerate(names):
        body = spec.worldbody.add_body(name=_body(name), pos=(0.0, 0.0, _ABOVE_M + 5.0 * index))
        for low, high in np.array(CHAIRS[name].boxes):
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=(low + high) / 2.0, size=(high - low) / 2.0)


def place_chair(model: mujoco.MjModel, names: Sequence[str], placed: Mapping[str, np.ndarray]) -> None:
    """Let the kinds ``placed`` stand at their poses (4, 4), and the others of ``names`` be over the room."""
    for index, name in enumerate(names):
        body = model.body(_body(name)).id
        model.body_pos[body], model.body_quat[body] = (0.0, 0.0, _ABOVE_M + 5.0 * index), (1.0, 0.0, 0.0, 0.0)
        if name in placed:
            yaw = math.atan2(placed[name][1, 0], placed[name][0, 0])
            model.body_pos[body] = placed[name][:3, 3]
            model.body_quat[body] = math.cos(yaw / 2.0), 0.0, 0.0, math.sin(yaw / 2.0)


def _body(name: str) -> str:
    return f"chair {name}"

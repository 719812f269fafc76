"""The reference room: the true room that a policy is tested in after it has learnt in splats.

Its geometry is true, its light is Cycles' (``tools.rooms.reference`` makes one), and its frame is the bundle's world
frame. Episodes begin where those of the same seed begin in training: the two are paired.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...config.fields import Range, setting
from ...core.digests import content_digest
from ...core.errors import SceneError
from ...geometry.collision.collision_files import SCENE_XML
from ...geometry.texture.surface_light_field import SurfaceLightField
from ...robot.behaviours.trajectory import Seat
from ...robot.planning.free_floor import FreeFloor, free_floor
from ...robot.planning.seats import TURN_M, find_seats
from ...views.room_looks import SurfaceLooks
from .randomization import Randomization
from .starts import Start, floor_around
from .training_scene import TrainingScene

LIGHT, COLLISION = "light.npz", "collision"
"""The files of a reference room: a surface light field, and a folder with the true collision surface's scene."""


@dataclass(frozen=True)
class ReferenceRandomization(Randomization):
    """What a reference room's episodes draw from: pictures as in training, dynamics that were not trained with."""

    latency_s: Range = setting((0.1, 0.2), "How old the picture is that is shown; up to 0.15 in training.", 0.0, 1.0)
    friction: Range = setting((0.5, 0.9), "Factor of the friction of everything; 0.7 to 1.3 in training.", 0.1, 10.0)
    mass: Range = setting((1.05, 1.1), "Factor of the robot's masses and inertias; at most 1.05 in training.", 0.5, 2.0)


REFERENCE_RANDOMIZATION = ReferenceRandomization()
"""The gap in dynamics between training and reference, declared before any policy was tested in it."""


@dataclass(frozen=True)
class ReferenceRoom:
    """What the room looks like, and ``scene``: the training scene's robot and task on the true surface."""

    looks: SurfaceLooks
    scene: TrainingScene

    @staticmethod
    def open(folder: Path, training: TrainingScene) -> ReferenceRoom:
        """The reference room in ``folder``, for what is trained in ``training``; read once a process.

        Raises SceneError where the folder is none, GeometryError for a damaged light field, and RobotError as
        ``free_floor`` does.
        """
        for needed in (folder / LIGHT, folder / COLLISION / SCENE_XML):
            if not needed.is_file():
                raise SceneError(
                    f"the reference room has no {needed.name}", where=folder, cure="Make it: see docs/policy.md."
                )
        mjcf = (folder / COLLISION / SCENE_XML).resolve()
        floor = free_floor(training.robot, training.scope, mjcf)
        looks = _looks((folder / LIGHT).resolve(), content_digest(folder / LIGHT))
        return ReferenceRoom(looks, replace(training, collision_mjcf=mjcf, floor=floor))

    def start(self, start: Start) -> Start:
        """A training's ``start`` on the true floor: at the same place with the same heading, or the nearest free
        place; its seat is the true one that is nearest, a separate chair stands where it stood."""
        floor = self.scene.floor if start.chair is None else floor_around(self.scene, start.chair)
        goal_m = None if start.goal_m is None else _nearest_free(floor, start.goal_m)
        seat = self._nearest_seat(start.seat) if start.seat is not None and start.chair is None else start.seat
        return replace(start, floor=floor, place_m=_nearest_free(floor, start.place_m), goal_m=goal_m, seat=seat)

    def _nearest_seat(self, seat: Seat) -> Seat:
        places = self._places
        apart = [np.linalg.norm(np.subtract(one.edge_m, seat.edge_m)) for one in places]
        turns = [abs(np.angle(np.exp(1j * (one.yaw_rad - seat.yaw_rad)))) for one in places]
        return places[int(np.argmin(np.array(apart) + TURN_M * np.array(turns)))]

    @functools.cached_property
    def _places(self) -> tuple[Seat, ...]:
        scene = self.scene
        return find_seats(scene.robot.half_width_m, scene.floor, scene.scope.sit_on, scene.collision_mjcf)


def _nearest_free(floor: FreeFloor, place_m: np.ndarray) -> np.ndarray:
    """The place (2,) itself where the floor is free there, else the middle of the nearest free cell."""
    if floor.is_free(place_m):
        return place_m
    free = floor.points(*np.nonzero(floor.free))
    nearest: np.ndarray = free[int(np.linalg.norm(free - place_m, axis=1).argmin())]
    return nearest


@functools.lru_cache(maxsize=2)
def _looks(file: Path, digest: str) -> SurfaceLooks:
    """``digest`` is the file's: one that has changed is another."""
    return SurfaceLooks(SurfaceLightField.load(file))

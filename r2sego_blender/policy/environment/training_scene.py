"""A bundle as a policy is trained in it: loaded once a process, shared by all its environments."""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from ...bundle.scene import Scene
from ...config.settings import RolloutSettings
from ...core.errors import AssetError, SceneError
from ...geometry.collision.collision_files import SCENE_XML
from ...robot.behaviours.trajectory import Seat
from ...robot.controllers.student import head_mount
from ...robot.model.model import RobotModel
from ...robot.planning.free_floor import FreeFloor, free_floor
from ...robot.planning.navigation import ways_to_seats
from ...robot.planning.seats import find_seats, one_a_surface
from ...robot.scope.scope import BehaviourScope
from ...splats.formats.registry import load_asset
from ...splats.kernels.packing import PackedGaussians
from .scene_digests import behaviour_of, scene_digests


@dataclass(frozen=True)
class TrainingScene:
    """Where episodes take place; nothing of it is changed by them.

    ``scope`` has its region's corners; ``collision_mjcf`` is the refined collision surface and
    ``floor`` where the robot may stand on it; ``asset`` is what the head camera sees.
    """

    robot: RobotModel
    scope: BehaviourScope
    settings: RolloutSettings
    collision_mjcf: Path
    asset: PackedGaussians
    floor: FreeFloor

    @staticmethod
    def open(bundle: Path, robot: str = "", scope: str = "", sits: bool = False, asset: str = "") -> TrainingScene:
        """The scene of a refined bundle; what is open already in this process is not read again.

        ``robot`` and ``scope`` stand in for those the bundle declares, as ``behaviour_of`` says.
        ``asset`` is another visual asset's file. Raises SceneError where the bundle is not refined,
        AssetError and RobotError as their loaders do.
        """
        declared = Scene.open(Path(bundle))
        file = Path(asset) if asset else declared.asset_file
        if asset and not file.is_file():
            raise AssetError("this visual asset is not there", where=file, cure="Check its path.")
        mjcf = declared.collision_folder / SCENE_XML
        for needed in (file, mjcf):
            if not needed.is_file():
                raise SceneError(
                    f"the scene has no {needed.name} yet", where=declared.path, cure="Run `r2sego refine` first."
                )
        digests = scene_digests(declared, file, behaviour_of(declared, sits, robot, scope))
        return _opened(declared.path.resolve(), robot, scope, sits, file.resolve(), json.dumps(digests))

    @cached_property
    def seats(self) -> tuple[Seat, ...]:
        """One place on each surface to sit on: the one in the middle of all that the surface offers.

        Raises RobotError where there is none.
        """
        places = find_seats(self.robot.half_width_m, self.floor, self.scope.sit_on, self.collision_mjcf)
        return one_a_surface(places)

    @cached_property
    def ways(self) -> tuple[np.ndarray, np.ndarray]:
        """The seat with the shortest way to the place before it, by index, and that way (ny, nx), metres."""
        return ways_to_seats(self.floor, self.seats)


@functools.lru_cache(maxsize=8)
def _opened(bundle: Path, robot: str, scope: str, sits: bool, asset: Path, digests: str) -> TrainingScene:
    """``digests`` are of all that is read: a scene that has changed is another."""
    scene = Scene.open(bundle)
    behaviour = behaviour_of(scene, sits, robot, scope)
    model = replace(behaviour.model, mount=head_mount(behaviour.model, behaviour.scope))
    placed = behaviour.placed_in(scene, scene.rounds_of_result() - 1)
    mjcf = scene.collision_folder / SCENE_XML
    return TrainingScene(
        robot=model,
        scope=placed,
        settings=scene.declaration.settings.rollouts,
        collision_mjcf=mjcf,
        asset=PackedGaussians.of(load_asset(asset)),
        floor=free_floor(model, placed, mjcf),
    )

"""A bundle as a policy is trained in it: loaded once a process, shared by all its environments."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from ...bundle.scene import Scene
from ...config.settings import RolloutSettings
from ...core.digests import content_digest
from ...core.errors import SceneError
from ...geometry.collision.collision_files import SCENE_XML
from ...refine.behaviour import DeclaredBehaviour
from ...robot.behaviours.trajectory import Seat
from ...robot.controllers.student import head_mount
from ...robot.model.model import RobotModel
from ...robot.planning.free_floor import FreeFloor, free_floor
from ...robot.planning.navigation import ways_to_seats
from ...robot.planning.seats import find_seats, one_a_surface
from ...robot.scope.scope import BehaviourScope
from ...splats.formats.registry import load_asset
from ...splats.kernels.packing import PackedGaussians


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

        ``robot`` and ``scope`` stand in for those the bundle declares. A declared scope without the
        behaviour of the task, to sit down where ``sits`` and else to walk, gives way to the library's.
        ``asset`` is another visual asset's file. Raises SceneError where the bundle is not refined,
        AssetError and RobotError as their loaders do.
        """
        declared = Scene.open(Path(bundle))
        file = Path(asset) if asset else declared.asset_file
        mjcf = declared.collision_folder / SCENE_XML
        for needed in (file, mjcf):
            if not needed.is_file():
                raise SceneError(
                    f"the scene has no {needed.name} yet", where=declared.path, cure="Run `r2sego refine` first."
                )
        key = tuple(map(content_digest, (file, declared.collision_folder, declared.path / "scene.toml")))
        return _opened(declared.path.resolve(), robot, scope, sits, file.resolve(), key)

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
def _opened(
    bundle: Path, robot: str, scope_name: str, sits: bool, asset: Path, digests: tuple[str, ...]
) -> TrainingScene:
    """``digests`` are of all that is read: a scene that has changed is another."""
    scene = Scene.open(bundle)
    scope = BehaviourScope.load(scope_name or scene.declaration.scope)
    if not scope_name and getattr(scope.behaviours, "sit_on" if sits else "walk_to") <= 0.0:
        scope = BehaviourScope.load("sit_down" if sits else "walk_and_look")
    behaviour = DeclaredBehaviour(scope, robot or scene.declaration.robot)
    model = replace(behaviour.model, mount=head_mount(behaviour.model, scope))
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

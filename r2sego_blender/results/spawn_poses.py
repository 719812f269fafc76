"""Where the declared robot may begin in a finished scene."""

from __future__ import annotations

from ..bundle.scene import Scene
from ..core.progress import SILENT, Progress
from ..geometry.collision.collision_files import SCENE_XML
from ..refine.behaviour import DeclaredBehaviour
from ..robot.rollouts.spawn_poses import SpawnPoses, find_spawn_poses


def spawn_poses_of(scene: Scene, progress: Progress = SILENT) -> SpawnPoses:
    """Those on the scene's collision surface, for its robot, scope and seed. Raises RobotError as
    ``find_spawn_poses`` does."""
    behaviour = DeclaredBehaviour.of(scene)
    settings = scene.declaration.settings
    return find_spawn_poses(
        behaviour.model,
        behaviour.placed_in(scene, scene.rounds_of_result() - 1),
        scene.collision_folder / SCENE_XML,
        settings.rollouts,
        settings.seed,
        progress,
    )

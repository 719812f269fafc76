"""The robot's bodies along a round's rollouts, a step of the bundle for those who show them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..bundle.runner import Runner
from ..bundle.scene import Scene
from ..captures.capture import Capture
from ..captures.store import CAPTURES
from ..core.errors import SceneError
from ..refine.behaviour import DeclaredBehaviour
from ..robot.model.robot_file import robot_digest
from ..robot.rollouts.bodies import save_bodies
from ..robot.rollouts.rollout import ROLLOUTS, Rollout
from .panels.rollout_bodies import BODIES


def export_bodies(scene: Scene, round_index: int) -> Path:
    """The folder ``rounds/l/bodies``, made anew where rollouts, robot or camera have changed.

    Raises SceneError where the round has no rollouts, RobotError where they are another
    robot's than the one declared now.
    """
    rollouts = ROLLOUTS.of_round(round_index)
    if not (scene.path / rollouts.name).is_dir():
        raise SceneError(
            f"round {round_index} has no rollouts", where=scene.path, cure="Run Refine, or choose another."
        )
    behaviour = DeclaredBehaviour.of(scene)
    source, mount = behaviour.scope.robot_for(scene.declaration.robot)

    eye = behaviour.ego_camera(scene.read(CAPTURES))

    def compute(folder: Path, captures: Sequence[Capture], attempts: tuple[Rollout, ...]) -> None:
        save_bodies(folder, behaviour.model, attempts, eye, scene.path / rollouts.name)

    bodies = BODIES.of_round(round_index)
    with scene.locked():
        known = [source, mount, robot_digest(source), eye.width, eye.height]
        Runner(scene).make(bodies, compute, CAPTURES, rollouts, settings=known)
    return scene.read(bodies)

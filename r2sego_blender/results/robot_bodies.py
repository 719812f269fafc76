"""The robot's bodies along a round's rollouts, a step of the bundle for those who show them."""

from __future__ import annotations

from pathlib import Path

from ..bundle.layout import CAPTURES, of_round
from ..bundle.scene import Scene
from ..captures.store import load_captures
from ..core.errors import SceneError
from ..robot.model.model import RobotModel
from ..robot.model.robot_file import robot_digest
from ..robot.rollouts.bodies import save_bodies
from ..robot.rollouts.candidates import ego_camera
from ..robot.rollouts.rollouts import load_rollouts
from ..robot.scope.scope import BehaviourScope


def export_bodies(scene: Scene, round_index: int) -> Path:
    """The folder ``rounds/l/bodies``, made anew where rollouts, robot or camera have changed.

    Raises SceneError where the round has no rollouts, RobotError where they are another
    robot's than the one declared now.
    """
    name = of_round(round_index, "rollouts")
    if not (scene.path / name).is_dir():
        raise SceneError(
            f"round {round_index} has no rollouts", where=scene.path, cure="Run Refine, or choose another."
        )
    declared = scene.declaration
    scope = BehaviourScope.load(declared.scope)
    source, mount = scope.robot_for(declared.robot)
    first = load_captures(scene.captures_folder)[0].camera
    # What earlier versions wrote of upright photographs had an upright lens: it is made anew.
    upright = ["landscape"] if first.height > first.width else []

    def compute(folder: Path) -> None:
        robot = RobotModel.load(source, mount)
        lens = ego_camera(robot, first)
        save_bodies(folder, robot, load_rollouts(scene.path / name), lens, scene.path / name)

    with scene.locked():
        return scene.step(
            of_round(round_index, "bodies"), compute, inputs=[CAPTURES, name],
            parameters=[source, mount, robot_digest(source), *upright],
        )  # fmt: skip

"""Trying the behaviour on the newest collision surface, without a round: a few attempts, kept apart."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from ..bundle.scene import Scene
from ..bundle.stale import require_present_frame
from ..captures.store import CAPTURES
from ..core.errors import SceneError
from ..core.progress import SILENT, Progress
from ..geometry.collision.collision_files import COLLISION
from ..geometry.objects.prior_files import PRIORS
from ..geometry.proxy.proxy import PROXY
from ..refine.behaviour import DeclaredBehaviour
from ..robot.planning.free_floor import free_floor
from ..robot.rollouts.assumptions import tell_assumptions
from ..robot.rollouts.attempts import Attempts, in_order
from ..robot.rollouts.bodies import save_bodies
from ..robot.rollouts.rollout import Rollout, save_rollouts
from ..robot.rollouts.rollouts import tell_warnings
from ..splats.artifacts import asset_before

TRIAL = "robot/trial"
"""Rollouts and the robot's bodies of the last trial, as a round has them in two folders."""


@dataclass(frozen=True)
class Surface:
    """What rollouts run on: the round that made it, and its collision scene."""

    round_index: int
    collision_mjcf: Path


def newest_surface(scene: Scene) -> Surface:
    """The collision surface made last. Raises SceneError when there is none yet, and when the world
    frame was corrected since."""
    index = scene.newest_round("collision/scene.xml")
    if index < 0:
        raise SceneError("there is no collision surface yet", where=scene.path, cure="Run Refine first.")
    proxy, collision = PROXY.of_round(index), COLLISION.of_round(index)
    require_present_frame(scene, [proxy.name, collision.name], "used")
    return Surface(index, scene.read(collision) / "scene.xml")


def try_rollouts(scene: Scene, attempts: int, progress: Progress = SILENT) -> tuple[Rollout, ...]:
    """The first ``attempts`` that a round would make on the newest collision surface.

    They are kept in ``TRIAL`` with the robot's bodies, in place of those of the last trial;
    no round changes. Raises SceneError where there is no surface yet, RobotError where the
    behaviour cannot be tried at all: no free floor, no seat, a robot that does not fit.
    """
    with scene.locked():
        surface, settings = newest_surface(scene), scene.declaration.settings
        behaviour, captures = DeclaredBehaviour.of(scene), scene.read(CAPTURES)
        proxy = scene.read(PROXY.of_round(surface.round_index))
        robot, placed = behaviour.model, behaviour.placed(captures, proxy, scene.read(PRIORS))
        tell_assumptions(robot, placed, progress)
        floor = free_floor(robot, placed, surface.collision_mjcf)
        seed = settings.seed * 1000 + surface.round_index
        sight = behaviour.sight(scene.read(asset_before(surface.round_index))) if behaviour.sees else None
        tried = in_order(
            Attempts(robot.source, robot.mount, placed, floor, surface.collision_mjcf, settings.rollouts, seed, sight)
        )
        rollouts = tuple(progress.track(islice(tried, attempts), "Rollouts", attempts))
        tried.close()
        tell_warnings(rollouts, progress)
        with scene.publishing(TRIAL) as folder:
            save_rollouts(folder, rollouts)
            save_bodies(folder, robot, rollouts, behaviour.ego_camera(captures), folder)
        return rollouts

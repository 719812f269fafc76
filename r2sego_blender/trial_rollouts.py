"""Trying the behaviour on the newest collision surface, without a round: a few attempts, kept apart."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from .captures.store import load_captures
from .errors import SceneError
from .geometry.priors import object_place
from .geometry.proxy import GeometryProxy
from .geometry.seen_floor import seen_floor
from .progress import SILENT, Progress
from .robot.attempts import Attempts, Rollout, in_order
from .robot.bodies import save_bodies
from .robot.candidates import ego_camera
from .robot.free_floor import free_floor
from .robot.model import RobotModel
from .robot.rollouts import save_rollouts
from .robot.scope import ANY_SEAT, FREE_FLOOR, BehaviourScope
from .scene import Scene
from .steps import PRIORS, of_round

TRIAL = "robot/trial"
"""Rollouts and the robot's bodies of the last trial, as a round has them in two folders."""


@dataclass(frozen=True)
class Surface:
    """What rollouts run on: the round that made it, its proxy and its collision scene."""

    round_index: int
    proxy: Path
    collision_mjcf: Path


def newest_surface(scene: Scene) -> Surface:
    """The collision surface made last. Raises SceneError when there is none yet."""
    for index in reversed(range(scene.declaration.settings.rounds)):
        proxy = scene.path / of_round(index, "proxy") / "proxy.npz"
        mjcf = scene.path / of_round(index, "collision") / "scene.xml"
        if proxy.is_file() and mjcf.is_file():
            return Surface(index, proxy, mjcf)
    raise SceneError("there is no collision surface yet", where=scene.path, cure="Run Refine first.")


def placed_scope(scene: Scene, scope: BehaviourScope, surface: Surface) -> BehaviourScope:
    """``scope`` in this scene, as a round places it: on the floor the captures saw, at its object."""
    within, target = scope.region.within, scope.sit_on.target
    if within == FREE_FLOOR:
        cameras = [capture.camera for capture in load_captures(scene.captures_folder)]
        within = tuple(map(tuple, seen_floor(GeometryProxy.load(surface.proxy), cameras).tolist()))
    if isinstance(target, str) and target != ANY_SEAT and scope.behaviours.sit_on > 0.0:
        target = object_place(scene.path / PRIORS, target)
    return replace(
        scope, region=replace(scope.region, within=within), sit_on=replace(scope.sit_on, target=target)
    )


def try_rollouts(scene: Scene, attempts: int, progress: Progress = SILENT) -> tuple[Rollout, ...]:
    """The first ``attempts`` that a round would make on the newest collision surface.

    They are kept in ``TRIAL`` with the robot's bodies, in place of those of the last trial;
    no round changes. Raises SceneError where there is no surface yet, RobotError where the
    behaviour cannot be tried at all: no free floor, no seat, a robot that does not fit.
    """
    with scene.locked():
        surface, declared = newest_surface(scene), scene.declaration
        scope = BehaviourScope.load(declared.scope)
        robot = RobotModel.load(*scope.robot_for(declared.robot))
        placed = placed_scope(scene, scope, surface)
        floor = free_floor(robot, placed, surface.collision_mjcf)
        settings = declared.settings
        seed = settings.seed * 1000 + surface.round_index
        tried = in_order(
            Attempts(
                robot.source, robot.mount, placed, floor, surface.collision_mjcf, settings.rollouts, seed
            )
        )
        rollouts = tuple(progress.track(islice(tried, attempts), "Rollouts", attempts))
        tried.close()
        first = load_captures(scene.captures_folder)[0].camera
        with scene.publishing(TRIAL) as folder:
            save_rollouts(folder, rollouts)
            save_bodies(folder, robot, rollouts, ego_camera(robot, first.width, first.height), folder)
        return rollouts

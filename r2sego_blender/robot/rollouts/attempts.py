"""Attempts at the behaviour, simulated in several processes and handed out in their order.

An attempt depends on the round's seed and its own number alone, so the number of processes
changes nothing but the time.
"""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections import deque
from collections.abc import Generator
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count
from multiprocessing.connection import wait
from pathlib import Path

import numpy as np

from ...config.settings import RolloutSettings
from ...core.errors import NativeError
from ...core.resources import available_cores
from ..controllers.controller import Controller, make_controller
from ..controllers.seeing_policy import Sight
from ..model.model import RobotModel
from ..model.mount import CameraMount
from ..model.mujoco_warnings import mujoco_warnings
from ..planning.free_floor import FreeFloor
from ..scope.scope import BehaviourScope
from .failures import Judge, Reason
from .rollout import Rollout
from .simulation import simulate
from .spawning import SpawnContext


@dataclass(frozen=True)
class Attempts:
    """What an attempt needs to know, as processes are told it; ``sight`` is what a student sees."""

    robot: str
    mount: CameraMount
    scope: BehaviourScope
    floor: FreeFloor
    collision_mjcf: Path
    settings: RolloutSettings
    seed: int
    sight: Sight | None = None

    def run(self, number: int) -> Rollout:
        """Attempt ``number``."""
        with mujoco_warnings() as heard:
            rollout = self._rollout(number)
        return replace(rollout, warnings=tuple(heard))

    def _rollout(self, number: int) -> Rollout:
        key = (self.seed, number)
        controller, robot = self._controller, self._model
        drive = controller.draw(np.random.default_rng(key))
        if drive is None:
            return Rollout(
                success=False,
                reason=str(Reason.NO_GOAL),
                frame=0,
                qpos=np.empty((0, robot.model.nq)),
                times_s=np.empty(0),
                camera_poses=np.empty((0, 4, 4)),
                seed=key,
                controller=controller.name,
                detail="no part of a motion fits the free floor or a seat"
                if self.scope.controller.kind == "replay"
                else "no reachable place lies in the scope's ranges",
            )
        done = simulate(controller.composition, drive, self._judge, self.scope.episode.camera_rate_hz)
        poses = robot.camera_poses(done.qpos, drive.mount)
        return Rollout(
            success=not done.reason,
            reason=str(done.reason),
            frame=len(done.qpos) - 1,
            qpos=done.qpos,
            times_s=done.times_s,
            camera_poses=poses,
            seed=key,
            behaviour=drive.behaviour,
            detail=done.detail,
            controller=controller.name,
            quality=done.meter.quality(poses),
        )

    @cached_property
    def _model(self) -> RobotModel:
        return RobotModel.load(self.robot, self.mount)

    @cached_property
    def _controller(self) -> Controller:
        return make_controller(self._model, self.floor, self.scope, self.collision_mjcf, self.settings, self.sight)

    @cached_property
    def _judge(self) -> Judge:
        return Judge(self._controller.composition, self.floor, self.scope, self._model.rest_height_m)


def in_order(attempts: Attempts) -> Generator[Rollout]:
    """Attempt after attempt without end; close the generator when there are enough.

    Raises RobotError where the scene does not compile with the robot, or has no seat to sit on;
    NativeError where one of the processes died.
    """
    processes = _processes(attempts.settings.processes)
    if processes == 1:
        yield from map(attempts.run, count())
    with ProcessPoolExecutor(processes, SpawnContext(), _begin, (attempts,)) as pool:
        numbers = count()
        ahead = deque(pool.submit(_run, next(numbers)) for _ in range(2 * processes))
        try:
            while True:
                ahead.append(pool.submit(_run, next(numbers)))
                yield ahead.popleft().result()
        except BrokenExecutor as error:
            raise NativeError(
                "a process that simulates died, as of too little memory",
                where="rollouts",
                cure="Close other programs, or let fewer run with rollouts.processes=1.",
            ) from error
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _processes(asked: int, system: str = os.name) -> int:
    """So many as were asked for, or as there are cores; Windows waits for no more than 61 at once."""
    count = asked or available_cores()
    return min(count, 61) if system == "nt" else count


_attempts: Attempts


def _begin(attempts: Attempts) -> None:
    """A process's own copy, which composes the scene once; it ends with its parent."""
    global _attempts
    _attempts = attempts
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=lambda: (wait([parent.sentinel]), os._exit(1)), daemon=True).start()


def _run(number: int) -> Rollout:
    return _attempts.run(number)

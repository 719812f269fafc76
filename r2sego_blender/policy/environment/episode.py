"""The physics of episodes: the robot on the refined collision surface, driven by commands, watched by a judge."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import mujoco
import numpy as np

from ...robot.controllers.commanded_drive import CommandedDrive, DriveCommand, DriveLimits
from ...robot.controllers.drive_actions import proprioception
from ...robot.controllers.twist2 import Twist2
from ...robot.controllers.velocity_pursuit import heading_rad
from ...robot.model.composition import compose
from ...robot.model.contacts import scene_contacts
from ...robot.rollouts.failures import SUCCESS, Judge, Reason
from ...robot.rollouts.quality import Meter
from ...robot.scope.scope import BehaviourScope
from .chairs import add_chairs, place_chair
from .randomization import Drawn
from .starts import Start
from .state import PrivilegedState
from .training_scene import TrainingScene

STEP_S = 0.1
"""A step of the environment: one command, and one picture."""

PHYSICS_S, TICK_S = 0.002, 0.02
"""A step of the simulation, and of the controller."""

_PHYSICS_A_TICK, _TICKS = round(TICK_S / PHYSICS_S), round(STEP_S / TICK_S)
_LONGEST_LATENCY_S = 1.0
# Who stands has moved no farther within this time: the sway of a gait is larger.
_STANDS_WITHIN_M, _STANDS_S = 0.04, 0.6
_STANDS_STEPS = round(_STANDS_S / STEP_S)


class Episode:
    """Episodes in a scene, one after the other; ``chairs`` are the kinds that may stand in it.

    A ``tracker``, TWIST2's ONNX file, balances the robot in the embedded controller's place, unaided.

    The model is compiled once; friction, masses and the chair's place are written into it and are
    its own again before others are.
    """

    def __init__(
        self,
        scene: TrainingScene,
        chairs: Sequence[str] = (),
        limits: DriveLimits | None = None,
        tracker: str | Path = "",
    ) -> None:
        """Raises RobotError as ``compose`` and ``Twist2``."""
        self.scene, self._chairs = scene, tuple(chairs)
        furnish = partial(add_chairs, names=self._chairs)
        where, settings = scene.collision_mjcf, scene.settings
        if tracker:
            twist2 = Twist2(tracker, scene.robot)
            self.composition = twist2.compose(where, settings, furnish)
            tracking = twist2.tracker(self.composition, scene.floor.floor_z_m)
        else:
            self.composition, tracking = compose(scene.robot, where, settings, step_s=PHYSICS_S, furnish=furnish), None
        model = self.composition.model
        self.drive = CommandedDrive(scene.robot, self.composition, scene.floor.floor_z_m, limits, tracking)
        self.data = mujoco.MjData(model)
        self._of_robot = np.array([model.body(body).name.startswith("robot/") for body in range(model.nbody)])
        self._as_compiled = {
            name: getattr(model, name).copy() for name in ("geom_friction", "body_mass", "body_inertia")
        }

    def start(self, start: Start, drawn: Drawn) -> None:
        """Begin anew. The same arguments give the same episode to the bit, whatever was before."""
        model, scene, chair = self.composition.model, self.scene, start.chair
        for array, values in self._as_compiled.items():
            getattr(model, array)[:] = values
        model.geom_friction[:, 0] *= drawn.friction
        model.body_mass[self._of_robot] *= drawn.mass
        model.body_inertia[self._of_robot] *= drawn.mass
        place_chair(model, self._chairs, {} if chair is None else {chair.name: chair.world_from_chair})
        mujoco.mj_setConst(model, self.data)
        mujoco.mj_resetData(model, self.data)
        self._start = start
        self._judge = Judge(self.composition, start.floor, judged_scope(scene), scene.robot.rest_height_m)
        self._meter = Meter(self.composition, start.seat, TICK_S)
        self.data.qpos[:] = self.drive.start(start.place_m, start.heading_rad)
        mujoco.mj_forward(model, self.data)
        self._steps = 0
        self.reason, self.detail = SUCCESS
        self._past: deque[np.ndarray] = deque(maxlen=round(_LONGEST_LATENCY_S / PHYSICS_S) + 1)
        self._past.append(self.data.qpos.copy())
        self._places: deque[np.ndarray] = deque(maxlen=_STANDS_STEPS + 1)
        self._places.append(self.data.qpos[:2].copy())

    def step(self, command: DriveCommand) -> None:
        """``STEP_S`` of it; less where it fails on the way."""
        model, data = self.composition.model, self.data
        self.drive.command(command)
        for _ in range(_TICKS):
            for _ in range(_PHYSICS_A_TICK):
                self.drive.apply(data, self._steps)
                mujoco.mj_step(model, data)
                self._past.append(data.qpos.copy())
                self._steps += 1
            contacts = scene_contacts(self.composition, data)
            self._meter.read(data, contacts)
            self.reason, self.detail = self._judge.state(data, contacts, self._start.seat, self._meter)
            if self.reason:
                break
        self._places.append(data.qpos[:2].copy())

    @property
    def succeeded(self) -> bool:
        """Whether the seat has carried the robot long enough, or it stands at its goal."""
        if self.reason:
            return False
        if self._start.goal_m is None:
            return self._meter.seated_s >= self.scene.scope.sit_on.hold_s
        near = math.dist(self.data.qpos[:2], self._start.goal_m) <= self.scene.scope.failures.goal_distance_m
        stood = len(self._places) > _STANDS_STEPS and math.dist(self._places[0], self._places[-1]) < _STANDS_WITHIN_M
        return near and stood

    def time_out(self) -> None:
        """It ends here, and what it has not reached is its failure."""
        if not self.reason and not self.succeeded:
            sits = self._start.seat is not None
            self.reason = Reason.MISSED_TARGET if sits else Reason.TIME_OUT
            self.detail = f"seated for {self._meter.seated_s:.1f} s" if sits else "not at the goal"

    def earlier(self, latency_s: float) -> np.ndarray:
        """(nq,) the configuration so long ago, at most a second; the start's where that is later."""
        steps = min(round(latency_s / PHYSICS_S), len(self._past) - 1)
        return self._past[-1 - steps]

    def state(self) -> PrivilegedState:
        """What is true now."""
        seated_s = self._meter.seated_s
        goal_m = self._start.goal_m
        return PrivilegedState(
            base_xy_m=self.data.qpos[:2].copy(),
            yaw_rad=heading_rad(self.data.qpos),
            base_height_m=float(self.data.qpos[2]),
            seat=self._start.seat,
            goal_xy_m=None if goal_m is None else goal_m.copy(),
            is_seated=seated_s > 0.0,
            seated_s=seated_s,
            time_s=self._steps * PHYSICS_S,
            mean_assist_n=self.drive.mean_assist_n,
            failure=str(self.reason),
        )

    def proprioception(self, last_action: np.ndarray) -> np.ndarray:
        """``drive_actions.proprioception`` after the ``last_action`` (4,)."""
        return proprioception(self.data, self.composition, self.scene.robot.rest_qpos, last_action)


def judged_scope(scene: TrainingScene) -> BehaviourScope:
    """The scope without what only asks how well a motion was carried out: feet that slip, joints at their stops."""
    failures = replace(scene.scope.failures, slide_m=0.0, penetration_m=0.0, joint_limit_deg=90.0, joint_limit_m=10.0)
    return replace(scene.scope, failures=failures)

"""Learned policies as the behaviour controller: they balance the robot themselves.

Nothing helps: no wrench on the base, no reference of the joints. A policy is told where to
go by velocity commands from the simulated base's own pose, and, where it takes one, a
height of the base.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np

from ...config.fields import Range
from ...config.settings import RolloutSettings
from ...core.errors import RobotError
from ..behaviours.trajectory import Seat
from ..model.composition import Composition, compose
from ..model.humanoid import Servo
from ..model.model import RobotModel
from ..model.mount import CameraMount
from ..planning.free_floor import FLATNESS_M, FreeFloor
from ..planning.navigation import draw_cell, draw_path, line_is_free
from ..scope.scope import BehaviourScope
from .policy_layout import PolicyLayout
from .policy_networks import Evaluate
from .policy_observation import Command, Observer
from .policy_runtime import PolicyFile
from .policy_worker import PolicyFailedError
from .velocity_pursuit import Stage, VelocityPursuit, straight

_BEHAVIOURS = ("walk_to", "look_around", "step_around", "squat")
_LOOK_AHEAD = 4  # points of a path that say where it begins to go
_TRIED_STEPS = 20
_LIFTS = 4
# Stood before anything else, and between two squats: a policy's first steps are its worst.
_STANDS_S = 0.5


@dataclass(frozen=True)
class DeclaredPolicy:
    """The policy of a scope, read, and what of a robot it drives.

    ``weights`` (4,) say how often each behaviour is drawn, and sum to 1; ``rest`` (nq,) is the
    configuration at rest; ``servos`` are those of the policy's joints, the held, then all others.
    """

    layout: PolicyLayout
    file: PolicyFile
    weights: np.ndarray
    rest: np.ndarray
    servos: dict[str, Servo]

    @staticmethod
    def load(robot: RobotModel, scope: BehaviourScope) -> DeclaredPolicy:
        """Raises RobotError as ``PolicyController`` does."""
        for field in ("file", "layout"):
            if not getattr(scope.controller, field):
                raise RobotError(f"controller.{field} is missing", where=scope.name, cure="See docs/controllers.md.")
        if scope.controller.tracker:
            raise RobotError(
                "controller.tracker tracks motions, and a policy follows none",
                where=scope.name,
                cure="Leave it out, or set controller.kind to reference or replay.",
            )
        layout = PolicyLayout.load(scope.controller.layout)
        file, weights = PolicyFile(scope.controller.file, layout), _weights(scope, layout)
        return DeclaredPolicy(layout, file, weights, *_held_and_driven(robot, layout))


class PolicyController:
    """Draws ways in the scope and has a policy go them; serves ``Controller``.

    Raises RobotError: a file or layout that cannot be used, joints the robot lacks, a
    behaviour that the policy has no commands for.
    """

    def __init__(
        self,
        robot: RobotModel,
        floor: FreeFloor,
        scope: BehaviourScope,
        collision_mjcf: Path,
        settings: RolloutSettings,
    ) -> None:
        self._robot, self._floor = robot, floor
        policy = DeclaredPolicy.load(robot, scope)
        self._layout, self._file, self._weights = policy.layout, policy.file, policy.weights
        self._rest = policy.rest
        self.name = f"policy {self._file.path.name}"
        layout = self._layout
        speed = _within(scope.walk_to.speed_m_s, layout.commands.vx_m_s[1])
        walk_to = replace(scope.walk_to, speed_m_s=speed)
        self._scope = replace(scope, walk_to=walk_to)  # type: ignore[call-arg]  # of a behaviour
        self.composition = compose(
            robot, collision_mjcf, settings, servos=policy.servos, wrench=False, step_s=layout.step_s
        )

    def draw(self, rng: np.random.Generator) -> PolicyDrive | None:
        """An attempt of a behaviour drawn from the scope; None where the floor offers no goal."""
        scope, floor = self._scope, self._floor
        behaviour = str(rng.choice(_BEHAVIOURS, p=self._weights))
        start = draw_cell(floor.free, rng)
        speed_m_s, turn_rate = (rng.uniform(*scope.walk_to.speed_m_s), _radians(scope.walk_to.turn_rate_deg_s, rng))
        heading = rng.uniform(-math.pi, math.pi)
        place = floor.points(*np.array(start))
        stood = Stage(place[None], heading, self._layout.commands.walking_height_m, _STANDS_S)
        if behaviour == "walk_to":
            path = draw_path(floor, start, scope, speed_m_s, rng)
            if path is None:
                return None
            ahead = path[min(len(path) - 1, _LOOK_AHEAD)] - path[0]
            heading = math.atan2(ahead[1], ahead[0]) + _radians(scope.start.heading_offset_deg, rng)
            stages = [replace(stood, path=path, facing_rad=None)]
            stood = replace(stood, facing_rad=heading)
        elif behaviour == "look_around":
            turned = heading + _radians(scope.look_around.turn_deg, rng)
            stages = [replace(stood, facing_rad=turned)]
        elif behaviour == "step_around":
            stages = self._steps(stood, rng)
        else:
            stages = self._squats(stood, rng)
        pitch = scope.look.camera_pitch_deg
        mount = self._robot.mount if pitch is None else self._robot.mount.pitched(rng.uniform(*pitch))
        return PolicyDrive(
            self.composition,
            self._layout,
            self._file.network(),
            self._file.path,
            VelocityPursuit([stood, *stages], self._layout.commands, speed_m_s, turn_rate),
            behaviour=behaviour,
            qpos=self._start(place, heading),
            rest=self._rest,
            duration_s=scope.episode.duration_s,
            goal=stages[-1].path[-1],
            mount=mount,
        )

    def _steps(self, stood: Stage, rng: np.random.Generator) -> list[Stage]:
        """Displacements on the free floor, facing one way."""
        ranges, stages = self._scope.step_around, [stood]
        for _ in range(_TRIED_STEPS):
            place = stages[-1].path[-1]
            angle, length = rng.uniform(-math.pi, math.pi), rng.uniform(*ranges.step_m)
            aim = place + length * np.array([math.cos(angle), math.sin(angle)])
            if line_is_free(self._floor.is_free, place, aim):
                stages.append(replace(stood, path=straight(place, aim), hold_s=rng.uniform(*ranges.pause_s)))
        # What the episode cannot finish has no goal to miss.
        return stages[: 1 + max(1, int(self._scope.episode.duration_s / 4.0))]

    def _squats(self, stood: Stage, rng: np.random.Generator) -> list[Stage]:
        """Lower and higher by turns, on the spot."""
        ranges, (low, high) = self._scope.squat, self._layout.commands.base_height_m or (0.0, 0.0)
        stages = []
        for _ in range(_TRIED_STEPS):
            height_m = min(max(rng.uniform(*ranges.height) * self._robot.rest_height_m, low), high)
            stages.append(replace(stood, height_m=height_m, hold_s=rng.uniform(*ranges.hold_s)))
            stages.append(stood)
        return stages

    def _start(self, place: np.ndarray, heading: float) -> np.ndarray:
        """(nq,) the layout's angles, standing on the floor at ``place``."""
        model, data = self._robot.model, mujoco.MjData(self._robot.model)
        qpos = self._rest.copy()
        qpos[:3] = (*place, 0.0)
        qpos[3:7] = (math.cos(heading / 2.0), 0.0, 0.0, math.sin(heading / 2.0))
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        soles_m = [float(leg.tip_place(data)[2]) - leg.sole_m for leg in self._robot.legs]
        lowest_m = min(soles_m, default=-self._robot.rest_height_m)
        qpos[2] = self._floor.floor_z_m - lowest_m
        return self._lifted(qpos)

    def _lifted(self, qpos: np.ndarray) -> np.ndarray:
        """``qpos`` (nq,), higher where the floor is: a start inside a bump would be a fault of ours."""
        model, data = self.composition.model, mujoco.MjData(self.composition.model)
        for _ in range(_LIFTS):
            data.qpos[:] = qpos
            mujoco.mj_kinematics(model, data)
            mujoco.mj_collision(model, data)
            depth_m = -float(data.contact.dist.min(initial=0.0))
            if depth_m <= 0.0 or depth_m > FLATNESS_M:  # what is deeper is no floor: let it be judged
                break
            qpos[2] += depth_m
        return qpos


class PolicyDrive:
    """One attempt of a policy; serves ``Drive``."""

    seat: Seat | None = None

    def __init__(
        self,
        composition: Composition,
        layout: PolicyLayout,
        network: Evaluate,
        file: Path,
        pursuit: VelocityPursuit,
        *,
        behaviour: str,
        qpos: np.ndarray,
        rest: np.ndarray,
        duration_s: float,
        goal: np.ndarray | None,
        mount: CameraMount,
    ) -> None:
        self.behaviour, self.qpos, self.duration_s = behaviour, qpos, duration_s
        self.goal, self.mount = goal, mount
        self.command = Command()
        """The last command that the policy was given."""
        self._layout, self._network, self._file, self._pursuit = layout, network, file, pursuit
        count = len(layout.joints)
        self._observer = Observer(layout, composition.qpos_address[:count], composition.dof_address[:count])
        self._action = np.zeros(layout.action_size)
        self._target = rest[composition.qpos_address]
        names = [joint.name for joint in layout.joints]
        for name, angle in layout.upper_body:
            self._target[names.index(name)] = angle
        self._zero_action = self._target.copy()

    def apply(self, data: mujoco.MjData, step: int) -> None:
        """Ask the policy at its rate, and hold its targets in between.

        Raises RobotError where a finite observation is not answered by as many finite numbers.
        """
        layout = self._layout
        if step % layout.decimation == 0:
            self.command = self._pursuit.command(data.qpos[:7], 1.0 / layout.rate_hz)
            time_s = step * layout.step_s
            observation = self._observer.observe(data, self.command, self._action, time_s)
            if np.isfinite(observation).all():  # a diverged simulation is the judge's matter
                self._action = self._asked(observation)
                self._target[layout.actions] = self._zero_action[layout.actions] + layout.action_scale * self._action
        data.ctrl[:] = self._target

    def _asked(self, observation: np.ndarray) -> np.ndarray:
        try:
            action = self._network(observation).astype(np.float64)
        except PolicyFailedError as error:
            raise RobotError(
                f"the policy failed while it was driving: {error}",
                where=self._file,
                cure="Export it again, or give another policy.",
            ) from error
        if action.shape != self._action.shape:
            raise RobotError(
                f"the policy gave {self._action.size} actions at first, and then {action.size}",
                where=self._file,
                cure="Export it again, or give another policy.",
            )
        if not np.isfinite(action).all():
            joint = self._layout.joints[self._layout.actions[int(np.argmin(np.isfinite(action)))]].name
            raise RobotError(
                f"the policy's action for {joint} is not finite",
                where=self._file,
                cure="Check the layout's scales, or give another policy.",
            )
        return np.clip(action, -self._layout.action_clip, self._layout.action_clip)


def _weights(scope: BehaviourScope, layout: PolicyLayout) -> np.ndarray:
    """How often each of ``_BEHAVIOURS`` is drawn; they sum to 1."""
    declared = {name: float(weight) for name, weight in vars(scope.behaviours).items() if weight > 0.0}
    able = set(_BEHAVIOURS) - (set() if layout.commands.base_height_m else {"squat"})
    if unable := sorted(set(declared) - able):
        raise RobotError(
            f"behaviours.{unable[0]} is nothing that {layout.name} can be told",
            where=scope.name,
            cure=f"Set it to 0; this policy is told: {', '.join(sorted(able))}.",
        )
    weights = np.array([declared.get(name, 0.0) for name in _BEHAVIOURS])
    return weights / weights.sum()


def _held_and_driven(robot: RobotModel, layout: PolicyLayout) -> tuple[np.ndarray, dict[str, Servo]]:
    """The configuration (nq,) at rest, and servos: the policy's joints, the held, then all others."""
    rest, servos, own = robot.rest_qpos.copy(), {}, robot.servos()
    for field, joints in (("joints", layout.joints), ("held", layout.held)):
        for joint in joints:
            if joint.name not in own:
                raise RobotError(
                    f"{field} name {joint.name}, which the robot {robot.source} has not",
                    where=layout.where,
                    cure=f"It has: {', '.join(own)}.",
                )
            rest[robot.model.joint(joint.name).qposadr[0]] = joint.default_rad
            servos[joint.name] = joint.servo
    return rest, servos | {name: servo for name, servo in own.items() if name not in servos}


def _within(limits: Range, highest: float) -> Range:
    return min(limits[0], highest), min(limits[1], highest)


def _radians(limits_deg: Range, rng: np.random.Generator) -> float:
    return math.radians(rng.uniform(*limits_deg))

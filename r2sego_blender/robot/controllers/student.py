"""A trained student as the behaviour controller: it sees the room through the round's visual asset and walks to a seat.

Ten times a second it is given what its environment gave it in training (``policy/environment``): the head's picture,
a tenth of a second old, and proprioception. What it says is commanded to the online drive.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from ...config.settings import RolloutSettings
from ...core.errors import RobotError
from ..behaviours.trajectory import Seat
from ..model.composition import compose
from ..model.model import RobotModel
from ..model.mount import CameraMount
from ..planning.course import Course
from ..planning.free_floor import FreeFloor
from ..planning.navigation import ways_to_seats
from ..planning.seats import find_seats, one_a_surface
from ..scope.scope import BehaviourScope
from .commanded_drive import CommandedDrive
from .drive_actions import SIZE, command_of, proprioception, proprioception_size
from .seeing_policy import HEAD_PICTURE, Act, SeeingPolicyFile, Sight
from .twist2 import Twist2

STEP_S = 0.1
"""From one picture and command to the next."""

# Seated so much longer than asked for that the judge, who measures at other times, has seen it.
_SEATED_MARGIN_S = 0.1


def head_mount(robot: RobotModel, scope: BehaviourScope) -> CameraMount:
    """The camera's mount with which a student is trained and sent out: in the middle of the scope's pitches."""
    pitch = scope.look.camera_pitch_deg
    return robot.mount if pitch is None else robot.mount.pitched(sum(pitch) / 2.0)


@dataclass(frozen=True)
class DeclaredStudent:
    """The student of a scope, read and tried, and the policy that balances the robot for it, if there is one."""

    file: SeeingPolicyFile
    twist2: Twist2 | None

    @staticmethod
    def load(robot: RobotModel, scope: BehaviourScope) -> DeclaredStudent:
        """Raises RobotError as ``StudentController`` does, but for what it sees."""
        if not scope.controller.file:
            raise RobotError("controller.file is missing", where=scope.name, cure="See docs/controllers.md.")
        others = [name for name, weight in vars(scope.behaviours).items() if weight > 0.0 and name != "sit_on"]
        if others:
            raise RobotError(
                f"behaviours.{others[0]} is nothing that a student has learned",
                where=scope.name,
                cure="Set it to 0: students walk to a seat and sit down (sit_on).",
            )
        file = SeeingPolicyFile(scope.controller.file, HEAD_PICTURE, proprioception_size(len(robot.servos())), SIZE)
        return DeclaredStudent(file, Twist2(scope.controller.tracker, robot) if scope.controller.tracker else None)


class StudentController:
    """Draws places to begin, and has a student go to the nearest seat; serves ``Controller``.

    Raises RobotError: no file, one with other inputs or outputs, a behaviour that is not sitting down, no seat, no
    ``sight``; as ``Twist2`` where the scope names a tracker.
    """

    def __init__(
        self,
        robot: RobotModel,
        floor: FreeFloor,
        scope: BehaviourScope,
        collision_mjcf: Path,
        settings: RolloutSettings,
        sight: Sight | None,
    ) -> None:
        declared = DeclaredStudent.load(robot, scope)
        if sight is None:
            raise RobotError(
                "a student sees the visual asset, and here is none", where=scope.name, cure="Roll out in a bundle."
            )
        self._robot, self._floor, self._scope, self._sight = robot, floor, scope, sight
        self._file, twist2 = declared.file, declared.twist2
        places = find_seats(robot.half_width_m, floor, scope.sit_on, collision_mjcf)
        self._seats = one_a_surface(places)
        self._nearest, _ = ways_to_seats(floor, self._seats)
        self._mount, tracker = head_mount(robot, scope), None
        if twist2 is None:
            self.composition = compose(robot, collision_mjcf, settings)
        else:
            self.composition = twist2.compose(collision_mjcf, settings)
            tracker = twist2.tracker(self.composition, floor.floor_z_m)
        self._drive = CommandedDrive(robot, self.composition, floor.floor_z_m, tracker=tracker)
        name = f"student {self._file.path.name}"
        self.name = name if twist2 is None else f"{twist2.name}, {name}"

    def draw(self, rng: np.random.Generator) -> StudentDrive | None:
        """An attempt from a place of the free floor; None where no way leads from there to a seat."""
        course = Course(self._floor, self._scope, rng, self._seats)
        cell = course.cell()
        nearest = int(self._nearest[cell])
        if nearest < 0:
            return None
        seat = self._seats[nearest]
        path = course.path_to(seat.ahead(seat.approach_m), cell)
        if path is None:
            return None
        heading = course.heading(path) if len(path) > 1 else rng.uniform(-math.pi, math.pi)
        return StudentDrive(self, path[0], heading, seat)


class StudentDrive:
    """One attempt of a student; serves ``Drive``. It ends early where a support has carried the robot long enough."""

    behaviour = "sit_on"
    goal: np.ndarray | None = None
    seat: Seat | None

    def __init__(self, controller: StudentController, place_m: np.ndarray, heading_rad: float, seat: Seat) -> None:
        self._controller, self._place = controller, (place_m, heading_rad)
        self.seat, self.mount = seat, controller._mount
        self.qpos = controller._drive.start(*self._place)
        self.duration_s = controller._scope.episode.duration_s
        self._step_s = controller.composition.model.opt.timestep
        self._decimation = round(STEP_S / self._step_s)
        self._act: Act = controller._file.start()
        self._seen, self._action = self.qpos, np.zeros(SIZE, np.float32)

    def apply(self, data: mujoco.MjData, step: int) -> None:
        """Ask the student at its rate, and drive as it says in between. Raises RobotError where it fails."""
        controller = self._controller
        drive = controller._drive
        if step == 0:  # the drive is the controller's, and may have driven another attempt since
            drive.start(*self._place)
        if step % self._decimation == 0 and np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all():
            rgb = controller._sight(self._seen, self.mount)
            felt = proprioception(data, controller.composition, controller._robot.rest_qpos, self._action)
            self._action = np.clip(self._act(rgb, felt), -1.0, 1.0).astype(np.float32)
            drive.command(command_of(self._action, drive.limits))
            self._seen = data.qpos.copy()
        drive.apply(data, step)
        if drive.seated_s >= controller._scope.sit_on.hold_s + _SEATED_MARGIN_S:
            self.duration_s = min(self.duration_s, (step + 1) * self._step_s)

"""Recorded motions as the behaviour controller: placed in the room, then tracked.

As with the embedded controller balance is the helping wrench's, not the motion's.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage

from ...config.settings import RolloutSettings
from ...core.errors import RobotError
from ..behaviours.trajectory import RATE_HZ, Seat
from ..model.model import RobotModel
from ..motion.dynamics import inverse_dynamics
from ..motion.foot_locking import foot_places
from ..motion.gait import Gait
from ..motion.motion import ReferenceMotion
from ..motion.recorded_motion import HumanRecording, frame_count, read_recording, robot_motion
from ..motion.retargeting import retarget
from ..planning.free_floor import FreeFloor
from ..planning.seats import find_seats
from ..scope.scope import BehaviourScope
from .motion_placement import placed_on_floor, placed_on_seat, seated_span
from .tracking import MotionTracking, TrackingDrive
from .twist2 import Twist2Drive

# A foot carries the more the lower and the stiller it is: nothing above this height, all below
# this speed, nothing at twice the speed.
_LOAD_WITHIN_M, _STILL_M_S = 0.03, 0.3
_LOAD_SMOOTHING_S = 0.04
_ON_SEAT_M, _SEAT_LOAD_S = 0.02, 0.1
# Seated longer than asked for, so that settling on the seat does not count.
_SEATED_MARGIN_S = 0.6
# The way to a seat lasts this long at least.
_APPROACH_S = 2.0
_TRIED_WINDOWS, _TRIED_SEATS = 24, 12
_SHORTEST_S = 0.5


@dataclass(frozen=True)
class Take:
    """A motion on the robot: ``qpos`` (T, nq) at ``RATE_HZ``, soles on z = 0; ``seated`` its first
    and last frame on a seat, None where it never sits."""

    name: str
    qpos: np.ndarray
    seated: tuple[int, int] | None


def load_take(path: str | Path, robot: RobotModel) -> Take:
    """Read a recorded motion and bring it onto ``robot``. Raises RobotError."""
    if not robot.legs:
        raise RobotError("the robot has no legs to replay a motion with", where=robot.source, cure="Give one.")
    recording = read_recording(path)
    frames = frame_count(recording.seconds)
    if frames < _SHORTEST_S * RATE_HZ:
        raise RobotError(f"the motion lasts {frames / RATE_HZ:.1f} s", where=path, cure="Give a longer one.")
    if isinstance(recording, HumanRecording):
        qpos = retarget(recording, robot)
    else:
        qpos = robot_motion(recording, robot)
    return Take(Path(path).stem, qpos, seated_span(qpos, robot))


@dataclass(frozen=True)
class DeclaredMotions:
    """The recorded motions of a scope on a robot.

    ``sits`` is the share of draws that sit down, ``seated`` those that sit long enough for it.
    """

    takes: tuple[Take, ...]
    sits: float
    seated: tuple[Take, ...]

    @staticmethod
    def load(robot: RobotModel, scope: BehaviourScope) -> DeclaredMotions:
        """Raises RobotError as ``ReplayController`` does."""
        if not scope.controller.motions:
            raise RobotError("controller.motions is empty", where=scope.name, cure="Name recorded motions.")
        takes = tuple(load_take(path, robot) for path in scope.controller.motions)
        sits = scope.behaviours.sit_on / sum(astuple(scope.behaviours))
        hold_s = scope.sit_on.hold_s + _SEATED_MARGIN_S
        seated = tuple(take for take in takes if take.seated and take.seated[1] - take.seated[0] > hold_s * RATE_HZ)
        if sits and not seated:
            raise RobotError(
                f"no motion sits for sit_on.hold_s = {scope.sit_on.hold_s:g} s",
                where=scope.name,
                cure="Set behaviours.sit_on to 0, or name a motion that sits.",
            )
        return DeclaredMotions(takes, sits, seated)


class ReplayController:
    """Draws recorded motions, or parts as long as an episode, at places where they fit; serves
    ``Controller``.

    With ``behaviours.sit_on`` its share of the draws are motions that end on a seat of the
    scene. Raises RobotError: no motions, files that cannot be used, no motion that sits.
    """

    def __init__(
        self,
        robot: RobotModel,
        floor: FreeFloor,
        scope: BehaviourScope,
        collision_mjcf: Path,
        settings: RolloutSettings,
    ) -> None:
        self._robot, self._floor, self._scope = robot, floor, scope
        declared, motions = DeclaredMotions.load(robot, scope), scope.controller.motions
        self._takes, self._sits, self._seated = declared.takes, declared.sits, declared.seated
        self._lowest_m = scope.failures.fall_height * robot.rest_height_m
        self._seats: tuple[Seat, ...] = ()
        if self._sits:
            self._seats = find_seats(robot.half_width_m, floor, scope.sit_on, collision_mjcf)
        self._tracking = MotionTracking(robot, floor, scope, collision_mjcf, settings)
        replayed = Path(motions[0]).name if len(motions) == 1 else f"{len(motions)} motions"
        self.name, self.composition = self._tracking.name(f"replay {replayed}"), self._tracking.composition

    def draw(self, rng: np.random.Generator) -> TrackingDrive | Twist2Drive | None:
        """A motion drawn and placed; None where none of those tried fits the floor."""
        motion = self._drawn_on_seat(rng) if rng.random() < self._sits else self._drawn_on_floor(rng)
        return None if motion is None else self._tracking.drive(motion, moving=True)

    def _drawn_on_floor(self, rng: np.random.Generator) -> ReferenceMotion | None:
        frames = round(self._scope.episode.duration_s * RATE_HZ) + 1
        for _ in range(_TRIED_WINDOWS):
            take = self._takes[int(rng.integers(len(self._takes)))]
            start = int(rng.integers(max(1, len(take.qpos) - frames + 1)))
            part = take.qpos[start : start + frames]
            if part[:, 2].min() < self._lowest_m:  # sits or lies, and would be judged fallen
                continue
            qpos = placed_on_floor(part, self._floor, rng)
            if qpos is not None:
                return self._reference(take, qpos, None, rng)
        return None

    def _drawn_on_seat(self, rng: np.random.Generator) -> ReferenceMotion | None:
        take = self._seated[int(rng.integers(len(self._seated)))]
        seated = round((self._scope.sit_on.hold_s + _SEATED_MARGIN_S) * RATE_HZ)
        assert take.seated is not None  # else it is not among those that sit
        end, shortest = take.seated[0] + seated, seated + round(_APPROACH_S * RATE_HZ)
        start = max(0, end - round(self._scope.episode.duration_s * RATE_HZ))
        for _ in range(_TRIED_SEATS):
            seat = self._seats[int(rng.integers(len(self._seats)))]
            depth_m = rng.uniform(*self._scope.sit_on.depth_m)
            part = take.qpos[start : end + 1]
            qpos = placed_on_seat(part, self._robot, self.composition, self._floor, seat, depth_m, shortest)
            if qpos is not None:
                return self._reference(take, qpos, seat, rng)
        return None

    def _reference(self, take: Take, qpos: np.ndarray, seat: Seat | None, rng: np.random.Generator) -> ReferenceMotion:
        pitch = self._scope.look.camera_pitch_deg
        mount = self._robot.mount if pitch is None else self._robot.mount.pitched(rng.uniform(*pitch))
        floor_z_m = self._floor.floor_z_m
        seat_load = None
        if seat is not None:
            on_seat = np.abs(qpos[:, 2] - qpos[-1, 2]) < _ON_SEAT_M
            seat_load = _smooth(on_seat.astype(float), _SEAT_LOAD_S)
        gait = gait_of(self._robot, qpos, floor_z_m)
        qvel, torque = inverse_dynamics(self._robot, qpos, gait, floor_z_m, seat_load)
        return ReferenceMotion(take.name, qpos, qvel, torque, qpos[-1, :2].copy(), mount, seat)


def gait_of(robot: RobotModel, qpos: np.ndarray, floor_z_m: float) -> Gait:
    """Where the feet of ``qpos`` (T, nq) are, and what share of the weight each may carry."""
    feet, heights = foot_places(robot, qpos)
    feet[..., 2] = heights - floor_z_m
    speed = np.linalg.norm(np.gradient(feet[..., :2], 1.0 / RATE_HZ, axis=1), axis=2)
    low = 1.0 - feet[..., 2] / _LOAD_WITHIN_M
    slow = 1.0 - (speed - _STILL_M_S) / _STILL_M_S
    load = _smooth(np.clip(np.minimum(low, slow), 1e-6, 1.0), _LOAD_SMOOTHING_S)
    still = np.zeros(len(qpos))
    return Gait(feet, load / load.sum(axis=0), still, still, still)


def _smooth(signal: np.ndarray, seconds: float) -> np.ndarray:
    return ndimage.gaussian_filter1d(signal, seconds * RATE_HZ, axis=-1, mode="nearest")

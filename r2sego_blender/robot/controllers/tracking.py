"""The embedded controller: a reference motion tracked in MuJoCo, not a learned policy.

Position servos drive every joint towards the reference, with the torques of its inverse
dynamics fed forward. Balance is not theirs: a spring-damper wrench on the pelvis, bounded on
each axis (a residual force, as motion-tracking controllers use), holds the base to the
reference. Gravity, contact, joint limits and effort limits act as they do; what pushes the
robot harder than the bounds makes it fall or stray, and the rollout fails. Where the scope names a
TWIST2 policy, that one tracks in its place, without any wrench (``twist2``).
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from ...config.settings import RolloutSettings
from ..behaviours.trajectory import RATE_HZ
from ..model.composition import Composition, compose
from ..model.model import RobotModel
from ..motion.motion import ReferenceMotion, plan_motion
from ..planning.course import require_legs
from ..planning.free_floor import FreeFloor
from ..planning.seats import find_seats
from ..scope.scope import BehaviourScope
from .twist2 import Twist2, Twist2Drive


class MotionTracking:
    """What tracks the motions of a scope on ``robot``, in the room of ``collision_mjcf``.

    ``composition`` is the robot there. Raises RobotError as ``compose`` and ``Twist2``.
    """

    def __init__(
        self,
        robot: RobotModel,
        floor: FreeFloor,
        scope: BehaviourScope,
        collision_mjcf: Path,
        settings: RolloutSettings,
    ) -> None:
        self._floor_z_m, file = floor.floor_z_m, scope.controller.tracker
        self._twist2 = Twist2(file, robot) if file else None
        made = self._twist2
        self.composition = made.compose(collision_mjcf, settings) if made else compose(robot, collision_mjcf, settings)

    def name(self, motions: str) -> str:
        """The controller's, of ``motions`` that it tracks."""
        return f"{self._twist2.name}, {motions}" if self._twist2 else motions

    def drive(self, motion: ReferenceMotion, moving: bool = False) -> TrackingDrive | Twist2Drive:
        """An attempt at ``motion``, which may be ``moving`` from its beginning on."""
        if self._twist2:
            return self._twist2.drive(self.composition, motion, self._floor_z_m, moving)
        return TrackingDrive(self.composition, motion, moving)


class TrackingController:
    """Draws reference motions of the scope's behaviours and tracks them."""

    def __init__(
        self,
        robot: RobotModel,
        floor: FreeFloor,
        scope: BehaviourScope,
        collision_mjcf: Path,
        settings: RolloutSettings,
    ) -> None:
        self._robot, self._floor, self._scope = robot, floor, scope
        require_legs(robot, scope)
        sits = scope.behaviours.sit_on > 0.0
        self._seats = find_seats(robot.half_width_m, floor, scope.sit_on, collision_mjcf) if sits else ()
        self._tracking = MotionTracking(robot, floor, scope, collision_mjcf, settings)
        self.name, self.composition = self._tracking.name("reference motions"), self._tracking.composition

    def draw(self, rng: np.random.Generator) -> TrackingDrive | Twist2Drive | None:
        """A drawn motion; None where the floor offers no goal."""
        motion = plan_motion(self._robot, self._floor, self._scope, rng, self._seats, self.composition)
        return None if motion is None else self._tracking.drive(motion)


class TrackingDrive:
    """Tracks one reference motion; one that is ``moving`` as it begins, in the middle of a step, with its velocity."""

    def __init__(self, composition: Composition, motion: ReferenceMotion, moving: bool = False) -> None:
        self.behaviour, self.goal = motion.behaviour, motion.goal
        self.seat, self.mount = motion.seat, motion.mount
        self.qpos = motion.qpos[0]
        self.duration_s = (len(motion.qpos) - 1) / RATE_HZ
        self._qvel = motion.qvel[0] if moving else None
        self._base, self._control = _references(composition, motion, self.duration_s)

    def apply(self, data: mujoco.MjData, step: int) -> None:
        """Write the servos' targets and the base's reference."""
        if step == 0 and self._qvel is not None:
            data.qvel[:] = self._qvel
        data.ctrl[:] = self._control[step]
        data.mocap_pos[0], data.mocap_quat[0] = self._base[step, :3], self._base[step, 3:]


def _references(composition: Composition, motion: ReferenceMotion, duration_s: float) -> tuple[np.ndarray, np.ndarray]:
    """The base's pose (steps, 7) and the actuators' controls (steps, nu)."""
    step_s = composition.model.opt.timestep
    at = np.arange(round(duration_s / step_s)) * step_s * RATE_HZ
    frame = np.minimum(at.astype(int), len(motion.qpos) - 2)
    part = (at - frame)[:, None]
    qpos = (1.0 - part) * motion.qpos[frame] + part * motion.qpos[frame + 1]
    qvel = (1.0 - part) * motion.qvel[frame] + part * motion.qvel[frame + 1]
    torque = (1.0 - part) * motion.torque[frame] + part * motion.torque[frame + 1]
    base = qpos[:, :7]
    base[:, 3:] /= np.linalg.norm(base[:, 3:], axis=1, keepdims=True)
    # The tracking wrench acts along the reference's axes; a free joint's velocity and force
    # are the world's where they are linear, and its body's where they are angular.
    into_base = Rotation.from_quat(base[:, [4, 5, 6, 3]]).inv()
    for vector in (qvel, torque):
        vector[:, :3] = into_base.apply(vector[:, :3])
    # A servo damps absolute velocity; aiming ahead makes it damp the error's instead.
    address = composition.dof_address
    control = (composition.damping * qvel[:, address] + torque[:, address]) / composition.stiffness
    control[:, 6:] += qpos[:, composition.qpos_address]
    return base, control

"""The embedded controller driven by commands: velocities and "sit", with nothing known ahead.

What ``tracking`` does for a reference motion planned beforehand this does for one that is
made as it goes on: servos on every joint, torques of inverse dynamics fed forward, and a
bounded helping wrench on the base, whose mean size is reported. A TWIST2 tracker can do it in its
place, without the wrench.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from ...core.errors import RobotError
from ..behaviours.trajectory import RATE_HZ
from ..model.composition import Composition
from ..model.contacts import SEATED_LOAD, scene_contacts
from ..model.leg_tracker import LegTracker
from ..model.model import RobotModel
from ..motion.commanded_base import CommandedBase, Leash
from ..motion.commanded_gait import CommandedGait
from ..motion.commanded_sitting import CommandedSitting, Phase
from ..motion.dynamics import FrameDynamics
from ..motion.upper_body import UpperBody
from .twist2 import Twist2Tracker
from .velocity_pursuit import heading_rad

# Legs walk a little bent: the middle of what the shipped scopes draw.
_PELVIS_HEIGHT = 0.955
# What is lower above the floor carries nobody who sits: who has fallen down is not seated.
_FLOOR_M = 0.1
_DT = 1.0 / RATE_HZ
# TWIST2 follows a reference from afar; one that stops for it and steps on all the same would make it step back.
_TRACKER_LEASH = Leash(m=(0.35, 0.7), rad=(0.5, 0.8))


@dataclass(frozen=True)
class DriveCommand:
    """Velocity of the base along and across its heading (m/s, ahead and to the left) and of its
    heading (rad/s, to the left); ``sit`` to be seated, else it stands or walks."""

    vx_m_s: float = 0.0
    vy_m_s: float = 0.0
    yaw_rate_rad_s: float = 0.0
    sit: bool = False


@dataclass(frozen=True)
class DriveLimits:
    """Velocities and accelerations that a drive keeps to, whatever is commanded."""

    vx_m_s: tuple[float, float] = (-0.3, 0.6)
    vy_m_s: tuple[float, float] = (-0.2, 0.2)
    yaw_rate_rad_s: tuple[float, float] = (-0.9, 0.9)
    acceleration_m_s2: float = 0.7
    turn_acceleration_rad_s2: float = 2.0


class CommandedDrive:
    """Drives ``robot`` in ``composition`` on a floor at ``floor_z_m``.

    The composition is one with the helping wrench, or else the ``tracker``'s own.
    """

    def __init__(
        self,
        robot: RobotModel,
        composition: Composition,
        floor_z_m: float,
        limits: DriveLimits | None = None,
        tracker: Twist2Tracker | None = None,
    ) -> None:
        if composition.has_wrench == (tracker is not None):
            raise RobotError(
                "the composition has no helping wrench, or a tracker has one",
                where=robot.source,
                cure="Compose the robot with it, or as the tracker wants it.",
            )
        self._tracker = tracker
        self.limits = limits = limits or DriveLimits()
        self._robot, self._composition = robot, composition
        self._steps = max(1, round(_DT / composition.model.opt.timestep))
        self._parts = np.arange(self._steps)[:, None] / self._steps
        self._height_m = robot.rest_height_m * (1.0 if robot.is_wheeled else _PELVIS_HEIGHT)
        self._floor_z_m = floor_z_m
        self._weight_n = composition.robot_mass_kg * 9.81
        acceleration = limits.acceleration_m_s2
        leash = Leash() if tracker is None else _TRACKER_LEASH
        accelerations = acceleration, acceleration, limits.turn_acceleration_rad_s2
        self._base = CommandedBase(accelerations, leash)
        fastest = [max(map(abs, pair)) for pair in (limits.vx_m_s, limits.vy_m_s, limits.yaw_rate_rad_s)]
        self._gait = CommandedGait(robot, fastest)
        self._sitting = None if robot.is_wheeled else CommandedSitting(robot, self._height_m)
        self._upper_body, self._legs = UpperBody(robot), LegTracker(robot)
        self._dynamics = FrameDynamics(robot, floor_z_m)
        self._soles_z_m = floor_z_m + np.array([leg.sole_m for leg in robot.legs])
        self._wanted, self._sit = (0.0, 0.0, 0.0), False
        self.start(np.zeros(2), 0.0)

    def start(self, place_m: np.ndarray, heading_rad: float) -> np.ndarray:
        """(nq,) the robot that stands at ``place_m`` (2,); what was commanded is forgotten."""
        self._base.start(float(place_m[0]), float(place_m[1]), heading_rad)
        self._gait.start(self._base.x, self._base.y, heading_rad)
        if self._sitting is not None:
            self._sitting.start()
        self._legs.restart()
        if self._tracker is not None:
            self._tracker.restart()
        self._rolled_m = np.zeros(len(self._robot.wheels))
        self._wanted, self._sit = (0.0, 0.0, 0.0), False
        self._carried, self.seated_s = 0.0, 0.0
        self._assist_sum_n, self._assist_count = 0.0, 0
        qpos = self._configuration()
        # The controls go from the first frame to the second, whose velocity takes the third.
        self._qpos = [qpos] * 4
        self._qvel = [np.zeros(self._robot.model.nv)] * 3
        self._stances = [(self._gait.feet.copy(), self._gait.load, 1.0)] * 3
        if self._tracker is None:
            self._ends = [self._control()] * 2
            self._interpolate()
        return qpos.copy()

    def command(self, command: DriveCommand) -> None:
        """Want this from now on. Raises RobotError: to sit asked of a robot without legs, no number."""
        values = command.vx_m_s, command.vy_m_s, command.yaw_rate_rad_s
        if not all(map(math.isfinite, values)):
            raise RobotError("a velocity is not finite", where=str(command), cure="Command numbers.")
        if command.sit and self._sitting is None:
            raise RobotError("to sit takes legs", where=self._robot.source, cure="Command velocities alone.")
        limits = self.limits
        ranges = limits.vx_m_s, limits.vy_m_s if self._robot.legs else (0.0, 0.0), limits.yaw_rate_rad_s
        vx, vy, rate = (min(max(value, low), high) for value, (low, high) in zip(values, ranges, strict=True))
        self._wanted, self._sit = (vx, vy, rate), command.sit

    def apply(self, data: mujoco.MjData, step: int) -> None:
        """Write the servos' targets and the base's reference of simulation step ``step``, the start's being 0.

        Raises RobotError where a tracker fails.
        """
        within = step % self._steps
        if within == 0:
            self._advance(data, measured=step > 0)
        if self._tracker is not None:
            if within == 0:
                data.ctrl[:] = self._tracker.targets(data, self._qpos[0], self._qvel[0])
            return
        data.ctrl[:] = self._controls[within]
        data.mocap_pos[0], data.mocap_quat[0] = self._places[within], self._turns[within]

    @property
    def is_lowering(self) -> bool:
        """Whether it goes back and down to sit."""
        return self._sitting is not None and self._sitting.phase is Phase.LOWERING

    @property
    def is_seated(self) -> bool:
        """Whether a support carries a good part of its weight."""
        return self._carried >= SEATED_LOAD

    @property
    def mean_assist_n(self) -> float:
        """Mean size of the helping force on the base since the start, N; 0 with a tracker."""
        return self._assist_sum_n / max(1, self._assist_count)

    def _advance(self, data: mujoco.MjData, measured: bool) -> None:
        """One frame: what was measured, and the reference of the frame after the next."""
        x, y, z = (float(value) for value in data.qpos[:3])
        real = x, y, heading_rad(data.qpos)
        if not all(map(math.isfinite, (*real, z))):  # a simulation that has diverged is not followed
            real, z = (self._base.x, self._base.y, self._base.yaw), self._height_m + self._floor_z_m
        touched = 0.0
        if measured:
            if self._tracker is None:
                self._assist_sum_n += math.sqrt(float(data.actuator_force[:3] @ data.actuator_force[:3]))
                self._assist_count += 1
            touched, self._carried = self._support(data)
            self.seated_s = self.seated_s + _DT if self.is_seated else 0.0
        wanted = self._wanted
        if self._sitting is not None:
            if self._sit or not self._sitting.is_upright:
                wanted = (0.0, 0.0, 0.0)
            stands = self._gait.stands and self._base.is_still
            ahead_m = (x - self._base.x) * math.cos(self._base.yaw) + (y - self._base.y) * math.sin(self._base.yaw)
            real_m = -ahead_m, self._floor_z_m + self._height_m - z
            self._sitting.advance(self._sit, stands, touched, self._carried, real_m)
            if not self._sitting.is_upright:  # who sits has its base behind where it stands
                back_m = self._sitting.back_m
                real = x + back_m * math.cos(self._base.yaw), y + back_m * math.sin(self._base.yaw), real[2]
        self._base.advance(wanted, real)
        self._gait.advance(self._base, wanted)
        self._roll()
        self._push(self._configuration())

    def _support(self, data: mujoco.MjData) -> tuple[float, float]:
        """What pushes the base and the thighs, and what of it lifts, as shares of the weight."""
        if self._sitting is None or self._sitting.is_upright:
            return 0.0, 0.0
        contacts = scene_contacts(self._composition, data)
        held = self._composition.seat_geoms[contacts.robot]
        held &= contacts.position_m[:, 2] > self._floor_z_m + _FLOOR_M
        force_n = contacts.force_n[held]
        return float(force_n.sum()) / self._weight_n, float(force_n @ contacts.level[held]) / self._weight_n

    def _configuration(self) -> np.ndarray:
        """(nq,) the reference now."""
        robot, base, gait, sitting = self._robot, self._base, self._gait, self._sitting
        qpos = robot.rest_qpos.copy()
        cos, sin = math.cos(base.yaw), math.sin(base.yaw)
        back_m = down_m = lean = reach = 0.0
        if sitting is not None:
            back_m, down_m, lean, reach = sitting.back_m, sitting.down_m, sitting.lean_rad, sitting.reach_rad
        qpos[0] = base.x - cos * back_m - sin * gait.sway_m
        qpos[1] = base.y - sin * back_m + cos * gait.sway_m
        qpos[2] = self._floor_z_m + self._height_m + gait.bob_m - down_m
        qpos[3:7] = math.cos(0.5 * base.yaw), 0.0, 0.0, math.sin(0.5 * base.yaw)
        self._upper_body.pose(qpos[None], 0.0, lean, gait.swing, reach)
        for wheel, rolled_m in zip(robot.wheels, self._rolled_m, strict=True):
            qpos[robot.model.jnt_qposadr[wheel.joint]] += wheel.forward * rolled_m / wheel.radius_m
        soles = gait.feet.copy()
        soles[:, 2] += self._soles_z_m
        self._legs.solve(qpos, soles)
        return qpos

    def _roll(self) -> None:
        forward, _, rate = self._base.velocity
        for index, wheel in enumerate(self._robot.wheels):
            self._rolled_m[index] += (forward - rate * wheel.offset_m[1]) * _DT

    def _push(self, qpos: np.ndarray) -> None:
        """Go on by a frame: ``qpos`` (nq,) is the newest, and gives the one before it its velocity."""
        on_feet = 1.0 if self._sitting is None else self._sitting.on_feet
        self._qpos = [*self._qpos[1:], qpos]
        self._stances = [*self._stances[1:], (self._gait.feet.copy(), self._gait.load, on_feet)]
        velocity = np.empty(self._robot.model.nv)
        mujoco.mj_differentiatePos(self._robot.model, velocity, 2.0 * _DT, self._qpos[1], self._qpos[3])
        self._qvel = [*self._qvel[1:], velocity]
        if self._tracker is None:
            self._ends = [self._ends[1], self._control()]
            self._interpolate()

    def _interpolate(self) -> None:
        """The controls (n, nu) and the base's reference, (n, 3) and (n, 4), of the frame's steps."""
        part, (before, after) = self._parts, self._ends
        self._controls = before + part * (after - before)
        pose = self._qpos[0][:7] + part * (self._qpos[1][:7] - self._qpos[0][:7])
        self._places = pose[:, :3]
        self._turns = pose[:, 3:] / np.linalg.norm(pose[:, 3:], axis=1, keepdims=True)

    def _control(self) -> np.ndarray:
        """(nu,) what the actuators are told in the frame before the newest; see ``tracking``."""
        composition, qpos, vectors = self._composition, self._qpos[1], np.empty((2, self._robot.model.nv))
        acceleration = (self._qvel[2] - self._qvel[0]) / (2.0 * _DT)
        vectors[0] = self._qvel[1]
        vectors[1] = self._dynamics.torque(qpos, self._qvel[1], acceleration, *self._stances[0])
        # Linear velocity and force of a free joint are the world's, the wrench's along the reference's axes.
        yaw = 2.0 * math.atan2(qpos[6], qpos[3])
        cos, sin = math.cos(yaw), math.sin(yaw)
        vectors[:, :2] = vectors[:, :2] @ np.array([[cos, -sin], [sin, cos]])
        velocity, torque = vectors[:, composition.dof_address]
        control = (composition.damping * velocity + torque) / composition.stiffness
        control[6:] += qpos[composition.qpos_address]
        return control

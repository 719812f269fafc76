"""TWIST2 (github.com/amazon-far/TWIST2) as what tracks reference motions: it balances the robot itself, unaided.

What ``tracking`` does with servos, torques and a helping wrench, its policy does with targets of the joints alone,
50 times a second. The weights are a person's to bring.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

from ...config.settings import RolloutSettings
from ...core.errors import RobotError
from ..model.composition import Composition, compose
from ..model.model import RobotModel
from ..model.unitree_g1 import JOINTS
from ..motion.motion import ReferenceMotion
from .onnx_network import OnnxNetwork
from .twist2_layout import DEFAULT_RAD, NETWORK, RATE_HZ, SERVOS, STEP_S, Observation, mimic, proprioception, targets_of
from .velocity_pursuit import heading_rad

# The policy is told velocities, so that it strays; what it has strayed is added to them at this share in a second.
_BACK_PER_S = 1.0


class Twist2:
    """The policy of a person's ``file`` on ``robot``.

    Raises RobotError: a robot that has not the G1's 29 joints and no others, a file that is no such policy.
    """

    def __init__(self, file: str | Path, robot: RobotModel) -> None:
        self._robot = robot
        if different := set(JOINTS) ^ set(robot.servos()):
            raise RobotError(
                f"TWIST2 drives the 29 joints of the Unitree G1, and not a robot that differs by {min(different)}",
                where=robot.source,
                cure="Give a G1 of 29 joints, or the embedded humanoid, or leave controller.tracker out.",
            )
        self._network = OnnxNetwork(file, NETWORK)

    @property
    def name(self) -> str:
        """Shown with every result."""
        return f"twist2 {self._network.path.name}"

    def compose(
        self, collision_mjcf: Path, settings: RolloutSettings, furnish: Callable[[mujoco.MjSpec], None] | None = None
    ) -> Composition:
        """The robot in the room with the servos and the step of the policy's training, and no helping wrench.

        Raises RobotError as ``composition.compose``.
        """
        return compose(
            self._robot, collision_mjcf, settings, servos=SERVOS, wrench=False, step_s=STEP_S, furnish=furnish
        )

    def tracker(self, composition: Composition, floor_z_m: float) -> Twist2Tracker:
        """What tracks one motion after the other in ``composition``, one of ``compose``."""
        return Twist2Tracker(self._network, composition, floor_z_m)

    def drive(self, composition: Composition, motion: ReferenceMotion, floor_z_m: float, moving: bool) -> Twist2Drive:
        """An attempt at ``motion``; ``moving`` from its beginning on."""
        return Twist2Drive(self.tracker(composition, floor_z_m), motion, moving, composition.model.opt.timestep)


class Twist2Tracker:
    """Targets of the joints, frame by frame of a reference at ``RATE_HZ``."""

    def __init__(self, network: OnnxNetwork, composition: Composition, floor_z_m: float) -> None:
        self._network, self._floor_z_m = network, floor_z_m
        self._qpos_address, self._dof_address = composition.qpos_address, composition.joint_dof_address
        self.restart()

    def restart(self) -> None:
        """Forget what was before."""
        self._observation = Observation()
        self._action = np.zeros(len(JOINTS), np.float32)

    def targets(self, data: mujoco.MjData, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
        """(29,) float64 rad for the frame whose reference is ``qpos`` (nq,), with the velocity ``qvel`` (nv,).

        A diverged simulation is the judge's matter, and keeps the last. Raises RobotError where the policy fails.
        """
        real_from_world = _base_from_world(data.qpos[3:7])
        strayed_m = qpos[:2] - data.qpos[:2]
        turned = math.remainder(heading_rad(qpos) - heading_rad(data.qpos), math.tau)
        wanted = np.array([*(qvel[:2] + _BACK_PER_S * strayed_m), qvel[2]])
        told = mimic(
            qpos[3:7],
            qpos[self._qpos_address],
            (real_from_world @ wanted)[:2],
            qvel[5] + _BACK_PER_S * turned,
            qpos[2] - self._floor_z_m,
        )
        joints, velocities = data.qpos[self._qpos_address], data.qvel[self._dof_address]
        felt = proprioception(data.qpos[3:7], data.qvel[3:6], joints, velocities, self._action)
        observation = self._observation.observe(told, felt)
        if np.isfinite(observation).all():
            self._action = self._network(observation)
        return targets_of(self._action)


class Twist2Drive:
    """Tracks one reference motion; serves ``Drive``."""

    def __init__(self, tracker: Twist2Tracker, motion: ReferenceMotion, moving: bool, step_s: float) -> None:
        self.behaviour, self.goal = motion.behaviour, motion.goal
        self.seat, self.mount = motion.seat, motion.mount
        self.qpos = motion.qpos[0]
        self.duration_s = (len(motion.qpos) - 1) / RATE_HZ
        self._tracker, self._motion, self._moving = tracker, motion, moving
        self._decimation = round(1.0 / (RATE_HZ * step_s))
        self._targets = DEFAULT_RAD

    def apply(self, data: mujoco.MjData, step: int) -> None:
        """Ask the policy at its rate, and hold its targets in between. Raises RobotError where it fails."""
        if step == 0 and self._moving:
            data.qvel[:] = self._motion.qvel[0]
        if step % self._decimation == 0:
            frame = min(step // self._decimation, len(self._motion.qpos) - 1)
            self._targets = self._tracker.targets(data, self._motion.qpos[frame], self._motion.qvel[frame])
        data.ctrl[:] = self._targets


def _base_from_world(quaternion: np.ndarray) -> np.ndarray:
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3).T

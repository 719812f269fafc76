"""Motion tokens of SONIC: 64 numbers at 50 Hz, which its decoder turns into targets of the G1's 29 joints.

Nothing helps the robot: no wrench on the base. A token belongs to one checkpoint; its weights are
NVIDIA's and a person's to bring.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from ...config.settings import RolloutSettings
from ...core.errors import RobotError
from ...robot.controllers.onnx_network import OnnxNetwork
from ...robot.model.composition import Composition, compose
from ...robot.model.model import RobotModel
from ...robot.model.structure import posed
from ...robot.model.unitree_g1 import JOINTS
from .sonic_layout import (
    DEFAULT_RAD,
    RATE_HZ,
    SERVOS,
    STEP_S,
    TOKEN_SIZE,
    DecoderObservation,
    ProprioceptiveFrame,
    targets_of,
)
from .sonic_networks import DECODER

BACKENDS = {"sonic_tokens": "motion tokens of SONIC, decoded by NVIDIA's network"}
ORDER = 1

SIZE = TOKEN_SIZE


def composition(robot: RobotModel, collision_mjcf: Path, settings: RolloutSettings) -> Composition:
    """See ``slot.ActionSpace``: SONIC's gains and step, no helping wrench; joints it does not know keep their servos.

    Raises RobotError for a robot without the G1's joints.
    """
    own = robot.servos()
    if missing := [name for name in JOINTS if name not in own]:
        raise RobotError(
            f"SONIC drives {missing[0]}, which the robot has not",
            where=robot.source,
            cure="Give a Unitree G1 with 29 joints, or the embedded humanoid.",
        )
    others = {name: servo for name, servo in own.items() if name not in SERVOS}
    return compose(robot, collision_mjcf, settings, servos=SERVOS | others, wrench=False, step_s=STEP_S)


def make(robot: RobotModel, composition: Composition, floor_z_m: float, *, decoder: str | Path, **_: Any) -> SonicDrive:
    """See ``slot.ActionSpace``; ``decoder`` is the file of SONIC's decoder. Raises RobotError."""
    return SonicDrive(robot, composition, floor_z_m, OnnxNetwork(decoder, DECODER))


class SonicDrive:
    """Serves ``slot.ActionDrive``; a token of zeros is wanted until there is another."""

    def __init__(self, robot: RobotModel, composition: Composition, floor_z_m: float, decoder: OnnxNetwork) -> None:
        self._robot, self._composition, self._floor_z_m, self._decoder = robot, composition, floor_z_m, decoder
        self._decimation = max(1, round(1.0 / (RATE_HZ * composition.model.opt.timestep)))
        self._joint_qpos = composition.qpos_address[: len(JOINTS)]
        self._joint_dof = composition.dof_address[: len(JOINTS)]
        self._rest = robot.rest_qpos.copy()
        self._rest[self._joint_qpos] = DEFAULT_RAD
        self._forget()

    def _forget(self) -> None:
        self._token = np.zeros(TOKEN_SIZE, np.float32)
        self._action = np.zeros(len(JOINTS), np.float32)
        self._observation = DecoderObservation()
        self._target = self._rest[self._composition.qpos_address]

    def start(self, place_m: np.ndarray, heading_rad: float) -> np.ndarray:
        """See ``slot.ActionDrive``: the soles on the floor, the joints at SONIC's default."""
        self._forget()
        qpos = self._rest.copy()
        qpos[:3] = (*np.asarray(place_m, np.float64), 0.0)
        qpos[3:7] = (math.cos(heading_rad / 2.0), 0.0, 0.0, math.sin(heading_rad / 2.0))
        data = posed(self._robot.model, qpos)
        qpos[2] = self._floor_z_m - min(float(leg.tip_place(data)[2]) - leg.sole_m for leg in self._robot.legs)
        return qpos

    def act(self, action: np.ndarray) -> None:
        """See ``slot.ActionDrive``: a token (64,), on the grid of levels or off it."""
        self._token = np.clip(np.asarray(action, np.float32), -1.0, 1.0)

    def apply(self, data: mujoco.MjData, step: int) -> None:
        """See ``slot.ActionDrive``. Raises RobotError where the decoder fails; a diverged state is not asked of it."""
        if step % self._decimation == 0:
            observation = self._observation.observe(self._felt(data), self._token)
            if np.isfinite(observation).all():
                self._action = self._decoder(observation)
                self._target[: len(JOINTS)] = targets_of(self._action)
        data.ctrl[:] = self._target

    def _felt(self, data: mujoco.MjData) -> ProprioceptiveFrame:
        base = np.empty(9)
        mujoco.mju_quat2Mat(base, data.qpos[3:7])
        return ProprioceptiveFrame(
            angular_velocity=data.qvel[3:6].copy(),  # MuJoCo's free joint turns in the base's own frame
            gravity=-base.reshape(3, 3)[2],
            joint_positions=data.qpos[self._joint_qpos],
            joint_velocities=data.qvel[self._joint_dof],
            action=self._action,
        )

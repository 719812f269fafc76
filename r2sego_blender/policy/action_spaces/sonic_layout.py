"""The numbers of SONIC's networks: orders, defaults, gains and scales of the G1's joints, and observations.

From NVlabs/GR00T-WholeBodyControl at 1983e88 (Apache-2.0), as its deployed C++ has them: ``policy_parameters.hpp``,
``observation_config.yaml`` of the release, and what gathers the observations in ``g1_deploy_onnx_ref.cpp``. Networks
see joints in IsaacLab's order, servos are in MuJoCo's, which is the robot's own.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from ...robot.model.humanoid import Servo
from ...robot.model.unitree_g1 import JOINTS, joint_part
from ...splats.quaternions import to_rotation

TOKEN_SIZE = 64
"""Two tokens of 32 dimensions, each of 32 levels."""

ENCODER_SIZE, DECODER_SIZE = 1762, 994
RATE_HZ = 50.0
STEP_S = 0.005
FRAMES = 10
"""Of the motion ahead, 0.1 s apart, in the encoder; of the past, 0.02 s apart, in the decoder."""

# fmt: off
ISAACLAB_TO_MUJOCO = np.array(
    [0, 3, 6, 9, 13, 17, 1, 4, 7, 10, 14, 18, 2, 5, 8, 11, 15, 19, 21, 23, 25, 27, 12, 16, 20, 22, 24, 26, 28]
)
"""(29,) int: ``isaaclab[ISAACLAB_TO_MUJOCO]`` is in MuJoCo's order."""
# fmt: on

MUJOCO_TO_ISAACLAB = np.argsort(ISAACLAB_TO_MUJOCO)
"""(29,) int: ``mujoco[MUJOCO_TO_ISAACLAB]`` is in IsaacLab's order."""

_LEG_RAD = (-0.312, 0.0, 0.0, 0.669, -0.363, 0.0)
DEFAULT_RAD = np.array(
    [
        *_LEG_RAD,
        *_LEG_RAD,
        *(0.0, 0.0, 0.0),
        *(0.2, 0.2, 0.0, 0.6, 0.0, 0.0, 0.0),
        *(0.2, -0.2, 0.0, 0.6, 0.0, 0.0, 0.0),
    ]
)
"""(29,) float64, MuJoCo's order: the angles where an action is 0."""

_NATURAL_RAD_S = 10.0 * math.tau
_DAMPING_RATIO = 2.0


@dataclass(frozen=True)
class _Motor:
    armature: float
    effort: float

    @property
    def servo(self) -> Servo:
        return Servo(self.armature * _NATURAL_RAD_S**2, 2.0 * _DAMPING_RATIO * self.armature * _NATURAL_RAD_S)

    @property
    def scale(self) -> float:
        return 0.25 * self.effort / self.servo.stiffness


_5020, _7520_14 = _Motor(0.003609725, 25.0), _Motor(0.010177520, 88.0)
_7520_22, _4010 = _Motor(0.025101925, 139.0), _Motor(0.00425, 5.0)
_MOTORS = {
    **dict.fromkeys(("hip_pitch", "hip_roll", "knee"), _7520_22),
    **dict.fromkeys(("hip_yaw", "waist_yaw"), _7520_14),
    **dict.fromkeys(("wrist_pitch", "wrist_yaw"), _4010),
}
_DOUBLED = ("ankle_pitch", "ankle_roll", "waist_roll", "waist_pitch")  # two motors move them together


def _servo(part: str) -> Servo:
    one, times = _MOTORS.get(part, _5020).servo, 2.0 if part in _DOUBLED else 1.0
    return Servo(times * one.stiffness, times * one.damping)


SERVOS = {joint: _servo(joint_part(joint)) for joint in JOINTS}
"""The servo of each joint, MuJoCo's order."""

ACTION_SCALE = np.array([_MOTORS.get(joint_part(joint), _5020).scale for joint in JOINTS])
"""(29,) float64 rad, MuJoCo's order: of one motor also where two pull."""


def targets_of(action: np.ndarray) -> np.ndarray:
    """(29,) float64 rad in MuJoCo's order, of the decoder's raw ``action`` (29,) in IsaacLab's."""
    return DEFAULT_RAD + np.asarray(action, np.float64)[ISAACLAB_TO_MUJOCO] * ACTION_SCALE


@dataclass(frozen=True)
class ProprioceptiveFrame:
    """What the robot feels at one tick of 50 Hz.

    ``angular_velocity`` (3,) rad/s and ``gravity`` (3,), of length 1, in the base's frame; ``joint_positions`` and
    ``joint_velocities`` (29,) rad and rad/s, MuJoCo's order, the positions as they are; ``action`` (29,) the
    decoder's last raw one, IsaacLab's order, zeros before the first.
    """

    angular_velocity: np.ndarray
    gravity: np.ndarray
    joint_positions: np.ndarray
    joint_velocities: np.ndarray
    action: np.ndarray


class DecoderObservation:
    """The decoder's observations, one after the other, of one attempt."""

    def __init__(self) -> None:
        self._frames: deque[ProprioceptiveFrame] = deque(maxlen=FRAMES)

    def observe(self, frame: ProprioceptiveFrame, token: np.ndarray) -> np.ndarray:
        """(994,) float32 with ``frame`` as the newest and ``token`` (64,).

        The token, then ten frames, oldest first, of each: angular velocity, joint positions relative to
        the default, joint velocities, raw actions, gravity. Before there are ten the first is repeated, as IsaacLab's
        history does in training.
        """
        self._frames.extend([frame] * (1 if self._frames else FRAMES))
        frames = self._frames
        parts = [
            np.asarray(token),
            *(one.angular_velocity for one in frames),
            *((one.joint_positions - DEFAULT_RAD)[MUJOCO_TO_ISAACLAB] for one in frames),
            *(one.joint_velocities[MUJOCO_TO_ISAACLAB] for one in frames),
            *(one.action for one in frames),
            *(one.gravity for one in frames),
        ]
        return np.concatenate(parts).astype(np.float32)


_MOTION_POSITIONS, _MOTION_VELOCITIES, _ANCHOR = slice(4, 294), slice(294, 584), slice(601, 661)


def encoder_observation(
    joint_positions: np.ndarray, joint_velocities: np.ndarray, base_quaternion: np.ndarray, reference: np.ndarray
) -> np.ndarray:
    """(1762,) float32 of the G1's own motion, mode 0, whose other modes' places are zeros.

    ``joint_positions`` and ``joint_velocities`` (10, 29) of the motion from now on, 0.1 s apart, rad and rad/s,
    MuJoCo's order, absolute. ``base_quaternion`` (4,) is the robot's, ``reference`` (10, 4) the motion's base with
    its heading turned to the robot's at the start; (w, x, y, z), of length 1.
    """
    observation = np.zeros(ENCODER_SIZE, np.float32)
    observation[_MOTION_POSITIONS] = joint_positions[:, MUJOCO_TO_ISAACLAB].reshape(-1)
    observation[_MOTION_VELOCITIES] = joint_velocities[:, MUJOCO_TO_ISAACLAB].reshape(-1)
    base_from_reference = to_rotation(base_quaternion[None])[0].T @ to_rotation(reference)
    observation[_ANCHOR] = base_from_reference[:, :, :2].reshape(-1)  # row by row
    return observation

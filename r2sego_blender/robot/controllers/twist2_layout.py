"""The numbers of TWIST2's policy: gains and defaults of the G1's joints, and what it observes.

From amazon-far/TWIST2 at d5c7108e (MIT), folder deploy_real: server_low_level_g1_sim for proprioception, history and
servos, server_motion_lib for what it is told of a motion. Joints are in MuJoCo's order.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from ..model.humanoid import Servo
from ..model.unitree_g1 import JOINTS, joint_part
from .onnx_network import NetworkLayout

RATE_HZ = 50.0
STEP_S = 0.002
"""The simulation's step in its training."""

MIMIC_SIZE = 6 + len(JOINTS)
"""Numbers it is told of a motion."""

FRAME_SIZE = MIMIC_SIZE + 5 + 3 * len(JOINTS)
"""Those, and its proprioception."""

PAST = 10
"""Frames of the past."""

NETWORK = NetworkLayout(
    "TWIST2 policy",
    "Give twist2_1017_20k.onnx as github.com/amazon-far/TWIST2 released it, see docs/controllers.md.",
    "input",
    (1 + PAST) * FRAME_SIZE + MIMIC_SIZE,
    "output",
    len(JOINTS),
)

_LEG_RAD = (-0.2, 0.0, 0.0, 0.4, -0.2, 0.0)
DEFAULT_RAD = np.array(
    [
        *_LEG_RAD,
        *_LEG_RAD,
        *(0.0, 0.0, 0.0),
        *(0.0, 0.4, 0.0, 1.2, 0.0, 0.0, 0.0),
        *(0.0, -0.4, 0.0, 1.2, 0.0, 0.0, 0.0),
    ]
)
"""(29,) float64: the angles where an action is 0."""

_SERVOS = {
    "hip": Servo(100.0, 2.0),
    "knee": Servo(150.0, 4.0),
    "ankle": Servo(40.0, 2.0),
    "waist": Servo(150.0, 4.0),
    "shoulder": Servo(40.0, 5.0),
    "elbow": Servo(40.0, 5.0),
    "wrist": Servo(4.0, 0.2),
}
SERVOS = {joint: _SERVOS[joint_part(joint).split("_")[0]] for joint in JOINTS}
"""The servo of each joint, MuJoCo's order."""

_ACTION_SCALE, _MOST_ACTION = 0.5, 10.0
_TURN_SCALE, _VELOCITY_SCALE = 0.25, 0.05
_ANKLES = np.array([index for index, joint in enumerate(JOINTS) if "ankle" in joint])


def targets_of(action: np.ndarray) -> np.ndarray:
    """(29,) float64 rad of the policy's raw ``action`` (29,)."""
    return DEFAULT_RAD + _ACTION_SCALE * np.clip(np.asarray(action, np.float64), -_MOST_ACTION, _MOST_ACTION)


def mimic(quaternion: np.ndarray, joints: np.ndarray, velocity_m_s: np.ndarray, rate: float, z_m: float) -> np.ndarray:
    """(35,) what the policy is told to do: velocity ahead and to the left, height, roll, pitch, turning rate, joints.

    ``quaternion`` (4,) wxyz of the motion's base, ``joints`` (29,) rad, ``velocity_m_s`` (2,) in the base's frame,
    ``rate`` rad/s about the base's own upright axis, ``z_m`` above the floor.
    """
    return np.array([*velocity_m_s, z_m, *_roll_pitch(quaternion), rate, *joints])


def proprioception(
    quaternion: np.ndarray, turning: np.ndarray, joints: np.ndarray, velocities: np.ndarray, action: np.ndarray
) -> np.ndarray:
    """(92,) what the robot feels; ``turning`` (3,) rad/s in the base's frame, ``action`` (29,) the last raw one."""
    scaled = _VELOCITY_SCALE * velocities
    scaled[_ANKLES] = 0.0
    return np.concatenate([_TURN_SCALE * turning, _roll_pitch(quaternion), joints - DEFAULT_RAD, scaled, action])


class Observation:
    """The policy's observations, one after the other, of one attempt."""

    def __init__(self) -> None:
        self._past = deque([np.zeros(FRAME_SIZE)] * PAST, maxlen=PAST)

    def observe(self, mimic: np.ndarray, proprioception: np.ndarray) -> np.ndarray:
        """(1432,) float32: the frame now, ten of the past from the oldest on, zeros before the first, and the
        ``mimic`` (35,) once more, in the place of a motion ahead."""
        frame = np.concatenate([mimic, proprioception])
        seen = np.concatenate([frame, *self._past, mimic]).astype(np.float32)
        self._past.append(frame)
        return seen


def _roll_pitch(quaternion: np.ndarray) -> tuple[float, float]:
    w, x, y, z = quaternion
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return roll, math.asin(min(max(2.0 * (w * y - z * x), -1.0), 1.0))

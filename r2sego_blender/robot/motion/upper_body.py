"""What the body does above its legs: gazes with the waist, swinging arms, leaning."""

from __future__ import annotations

import math

import numpy as np

from ..behaviours.trajectory import RATE_HZ, RootTrajectory, eased
from ..model.model import RobotModel
from ..model.structure import axes_in_base, posed
from ..planning.course import draw
from ..scope.scope import BehaviourScope
from .gait import Gait

_ARM_SWING_RAD = 0.3
# Fastest gaze: the camera turns no quicker than an unhurried person's head.
_GAZE_RATE_RAD_S = math.radians(75.0)
_MIN_GAZE_S = 0.4
# The waist keeps this far inside its limits.
_LIMIT_MARGIN_RAD = 0.02

_Angle = np.ndarray | float


def upper_body(
    robot: RobotModel, root: RootTrajectory, gait: Gait, scope: BehaviourScope, rng: np.random.Generator
) -> np.ndarray:
    """(T, nq): the resting posture with the waist looking around and the arms swinging."""
    qpos = np.tile(robot.rest_qpos, (len(root.yaw), 1))
    yaw, pitch = _gaze(len(root.yaw), scope, rng)
    UpperBody(robot).pose(qpos, yaw, pitch + root.lean, gait.swing, root.reach)
    return qpos


class UpperBody:
    """The joints of a robot's waist and shoulders, and which way they turn."""

    def __init__(self, robot: RobotModel) -> None:
        model = robot.model
        axes = axes_in_base(posed(model, robot.rest_qpos), robot.base)
        self._waist = []
        for joint, axis in ((robot.waist_yaw, 2), (robot.waist_pitch, 1)):
            if joint is not None:
                low, high = model.jnt_range[joint] if model.jnt_limited[joint] else (-np.inf, np.inf)
                bounds = low + _LIMIT_MARGIN_RAD, high - _LIMIT_MARGIN_RAD
                self._waist.append((model.jnt_qposadr[joint], axis, np.sign(axes[joint, axis]), bounds))
        self._shoulders = [
            (model.jnt_qposadr[joint], side, -np.sign(axes[joint, 1]))  # about the left, an arm falls
            for joint, side in zip(robot.shoulders, (1.0, -1.0), strict=False)
        ]

    def pose(self, qpos: np.ndarray, yaw: _Angle, pitch: _Angle, swing: _Angle, reach: _Angle) -> None:
        """Write the waist's angles into ``qpos`` (T, nq), which has the shoulders at rest, and move these.

        ``yaw``, ``pitch`` and ``reach`` (T,) or one, radians to the left and forward; ``swing``
        in [-1, 1].
        """
        for address, axis, sign, (low, high) in self._waist:
            qpos[:, address] = np.clip(sign * (yaw if axis == 2 else pitch), low, high)
        for address, side, lifting in self._shoulders:
            qpos[:, address] += side * _ARM_SWING_RAD * swing + lifting * reach


def _gaze(frames: int, scope: BehaviourScope, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Waist yaw and pitch (T,) radians: gazes drawn from the scope, held, eased between."""
    times = np.arange(frames) / RATE_HZ
    limits = np.radians([scope.look.waist_yaw_deg, scope.look.waist_pitch_deg])
    gaze = rng.uniform(limits[:, 0], limits[:, 1])
    angles = np.tile(gaze, (frames, 1))
    at_s = 0.0
    while at_s < times[-1]:
        start_s = at_s + draw(scope.look.hold_s, rng)
        target = rng.uniform(limits[:, 0], limits[:, 1])
        # The eased turn's greatest rate is 1.875 times its mean rate.
        moving_s = max(_MIN_GAZE_S, 1.875 * float(np.abs(target - gaze).max()) / _GAZE_RATE_RAD_S)
        angles += eased((times - start_s) / moving_s)[:, None] * (target - gaze)
        gaze, at_s = target, start_s + moving_s
    return angles[:, 0], angles[:, 1]

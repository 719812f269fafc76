"""Corrections of generated frames while an asset learns from them: exposure and pose.

A generated frame is seldom as bright as the captures, and its estimated pose is a little
off. The image is compared with ``gain * rendering + offset`` a channel, and the camera moved
by a small rotation and translation of its own frame; both follow Adam, slowly, so that the
captures, which are never corrected, keep deciding.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from scipy.spatial.transform import Rotation

from ...config.training_settings import TrainingSettings
from ...core.cameras import Camera

_BETA_1, _BETA_2 = 0.9, 0.999
_LARGEST_TURN_RAD, _LARGEST_SHIFT_M = math.radians(3.0), 0.05
"""A pose that wants to move farther was not estimated, it was wrong."""


class _Adam:
    """The plain optimiser for a handful of numbers."""

    def __init__(self, start: np.ndarray) -> None:
        self.values = np.asarray(start, np.float64)
        self._first, self._second, self._steps = np.zeros_like(self.values), np.zeros_like(self.values), 0

    def step(self, gradient: np.ndarray, rate: float) -> None:
        self._steps += 1
        self._first = _BETA_1 * self._first + (1.0 - _BETA_1) * gradient
        self._second = _BETA_2 * self._second + (1.0 - _BETA_2) * gradient**2
        m = self._first / (1.0 - _BETA_1**self._steps)
        v = self._second / (1.0 - _BETA_2**self._steps)
        self.values = self.values - rate * m / (np.sqrt(v) + 1e-15)


class Correction:
    """The exposure and pose of one frame."""

    def __init__(self, settings: TrainingSettings, refines_exposure: bool, refines_pose: bool) -> None:
        self._settings = settings
        self.refines_exposure, self.refines_pose = refines_exposure, refines_pose
        self._exposure = _Adam(np.array([[1.0] * 3, [0.0] * 3]))
        self._twist = _Adam(np.zeros(6))

    @property
    def exposure(self) -> tuple[np.ndarray, np.ndarray]:
        """The channels' gain and offset (3,) float32."""
        gain, offset = self._exposure.values.astype(np.float32)
        return gain, offset

    def camera(self, camera: Camera) -> Camera:
        """The camera with its corrected pose."""
        if not self.refines_pose or not self._twist.values.any():
            return camera
        twist = np.eye(4)
        twist[:3, :3] = Rotation.from_rotvec(self._twist.values[:3]).as_matrix()
        twist[:3, 3] = self._twist.values[3:]
        return dataclasses.replace(camera, world_from_camera=np.linalg.inv(twist @ camera.camera_from_world))

    def expose(self, planes: np.ndarray) -> np.ndarray:
        """The rendering's planes (3, H', W') as the frame would show them."""
        gain, offset = self.exposure
        return planes * gain[:, None, None] + offset[:, None, None]

    def learn_exposure(self, planes: np.ndarray, gradient: np.ndarray) -> None:
        """One step from the loss' gradient in the exposed planes, which becomes that in ``planes``.

        Both have the shape of the camera's image, (3, H, W).
        """
        by_gain = np.einsum("chw,chw->c", gradient, planes, dtype=np.float64)
        by_offset = gradient.sum(axis=(1, 2), dtype=np.float64)
        gradient *= self.exposure[0][:, None, None]
        self._exposure.step(np.stack([by_gain, by_offset]), self._settings.exposure_learning_rate)

    def learn_pose(self, gradient: np.ndarray) -> None:
        """One step from the pose's gradient (6,), see ``rasterizer.Gradients``."""
        self._twist.step(gradient, self._settings.pose_learning_rate)
        turn, shift = self._twist.values[:3], self._twist.values[3:]
        for part, largest in ((turn, _LARGEST_TURN_RAD), (shift, _LARGEST_SHIFT_M)):
            part *= min(1.0, largest / max(float(np.linalg.norm(part)), 1e-30))

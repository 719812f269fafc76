"""What training asks of an engine: an image, a step along the image's gradient, and its Gaussians back.

Losses, corrections, schedules and densification stand outside, once for every engine: they read
and write image planes, and the packed Gaussians while an engine lends them. An engine is a file of
this folder: its ``BACKENDS`` and ``ORDER`` (see ``config.slots``), ``make``, and ``require``, which
raises SettingsError where it cannot run.
"""

from __future__ import annotations

import contextlib
import importlib
from types import ModuleType
from typing import Protocol, cast

import numpy as np

from ...config.slots import TRAINERS
from ...core.cameras import Camera
from ..kernels.adam import AdamState
from ..kernels.packing import PackedGaussians
from ..rendering.rasterizer import Background


class SplatBackend(Protocol):
    """Renders the Gaussians it was made for, and moves those that an image shows by steps of Adam.

    Planes are (5, H', W') float32 in whole tiles, as ``Rasterizer`` has them: red, green, blue,
    transmittance, sum of weight * depth. They stay valid until the next ``forward``.
    """

    def __len__(self) -> int:
        """The number of Gaussians."""

    def forward(
        self, camera: Camera, background: Background, degree: int, with_depth: bool, dilation_px2: float
    ) -> None:
        """Fill ``planes``; see ``Rasterizer.forward``."""

    @property
    def planes(self) -> np.ndarray:
        """The image; what lies outside the camera's means nothing, nor the depth if it was not asked for."""

    @property
    def gradient_planes(self) -> np.ndarray:
        """For the loss' gradients in colour, alpha and the depth sum; 0 outside the camera's image."""

    def step(
        self,
        rates: np.ndarray,
        opacity_regularization: float,
        scale_regularization: float,
        with_alpha: bool,
        with_depth: bool,
    ) -> None:
        """Move the Gaussians along ``gradient_planes``; see ``Rasterizer.step``."""

    def pose_gradient(self) -> np.ndarray:
        """(6,) float64, that of the last ``step`` in the camera's pose; see ``rasterizer.Gradients``."""

    def leaving_out(self, left_out: np.ndarray | None) -> contextlib.AbstractContextManager[None]:
        """While this lasts, the places (chunks, 16) bool are neither rendered nor moved; None: all are."""

    def bound_log_scales(self, largest: float) -> None:
        """Make no logarithm of a scale larger than ``largest``."""

    @property
    def gaussians(self) -> PackedGaussians:
        """The Gaussians as they are now, to be read."""

    def lent(self) -> contextlib.AbstractContextManager[None]:
        """While this lasts, the packed Gaussians and Adam's state that it was made for are current, and
        may be changed, added and removed."""


def require_backend(name: str) -> None:
    """Raise SettingsError, with a cure, when the engine of ``training.backend`` cannot run here."""
    _module(name).require()


def make_backend(name: str, gaussians: PackedGaussians, state: AdamState) -> SplatBackend:
    """The engine of ``training.backend``. Raises as ``require_backend``; another is never taken instead."""
    return cast(SplatBackend, _module(name).make(gaussians, state))


def _module(name: str) -> ModuleType:
    return importlib.import_module(f".{TRAINERS.module(name)}", __package__)

"""A camera's exposure metering, as the captures show it: by how bright what it looks at is, and as it did nearby.

A camera that exposes by itself brings what it sees to about one mean brightness. Of captures with known exposures
this foretells that of one left out; where it does so worse than the captures near alone, it is not used.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...captures.capture import Capture
from ...core.cameras import Camera
from ...core.colours import linear_from_srgb

_NEAREST = 0.05
"""What is added to a capture's distance, metres and radians together, so that one at the same place is not all."""
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear sRGB (IEC 61966-2-1)."""
_DARKEST = 1e-4
"""The least mean luminance that is told from black."""

_ROUNDING = 1e-4
"""By so much of a logarithm one rule foretells better than another where both are right: nothing is learned of it."""

SeenByCaptures = Callable[[Camera], tuple[np.ndarray, np.ndarray]]
"""Gives of a camera a picture (H, W, 3) at the captures' one exposure, and where (H, W) bool captures saw it."""


@dataclass(frozen=True)
class Metering:
    """How the camera that took ``captures`` exposes: log factors from their one exposure to a photograph's.

    ``seen`` gives what captures saw of a view; None where that is not known, and the captures near tell alone.
    """

    captures: Sequence[Capture]
    seen: SeenByCaptures | None = None

    def log_exposure(self, camera: Camera) -> np.ndarray:
        """(3,) of linear red, green and blue, of a photograph taken with ``camera``."""
        near = _nearness(camera, [capture.camera for capture in self.captures])
        as_near: np.ndarray = near @ self._exposures
        if self.seen is None or not self.meters:
            return as_near
        picture, known = self.seen(camera)
        if not known.any():
            return as_near
        brightness = _log_luminance(linear_from_srgb(picture[known]).mean(axis=0) * np.exp(as_near))
        # What none saw is taken for as bright as the captures near are.
        return as_near + known.mean() * (near @ self._brightness - brightness)

    @cached_property
    def meters(self) -> bool:
        """Whether the captures' exposures, each left out in turn, follow how bright what they show is."""
        if len(self.captures) < 3:  # of two, one tells the other's brightness and nothing of a rule
            return False
        by_near, by_metering = np.sqrt(np.square(self.left_out_errors()).mean(axis=0))
        return bool(by_metering < by_near - _ROUNDING)

    def left_out_errors(self) -> np.ndarray:
        """(N, 2) what the log exposure of each capture, left out, is off by those near it alone and by metering."""
        errors = np.empty((len(self.captures), 2))
        for index, capture in enumerate(self.captures):
            others = np.delete(np.arange(len(self.captures)), index)
            near = _nearness(capture.camera, [self.captures[other].camera for other in others])
            errors[index, 0] = _LUMINANCE @ (near @ self._exposures[others] - self._exposures[index])
            # Its own brightness is known: what is off is what the others near it had as they were taken.
            errors[index, 1] = near @ self._brightness[others] - self._brightness[index]
        return errors

    @cached_property
    def _exposures(self) -> np.ndarray:
        """(N, 3) logarithms of the captures' own factors."""
        return -np.log([capture.gain or (1.0, 1.0, 1.0) for capture in self.captures])

    @cached_property
    def _brightness(self) -> np.ndarray:
        """(N,) logarithms of the mean linear luminance of the captures as they were taken."""
        means = [linear_from_srgb(capture.as_taken()).mean(axis=(0, 1)) for capture in self.captures]
        return np.array([_log_luminance(mean) for mean in means])


def _nearness(camera: Camera, others: Sequence[Camera]) -> np.ndarray:
    """(N,) weights that sum to 1: the inverse square of how far ``others`` stand and look away."""
    apart = np.array([np.linalg.norm(other.centre - camera.centre) + _angle_rad(other, camera) for other in others])
    weights = (_NEAREST + apart) ** -2.0
    return weights / weights.sum()


def _angle_rad(one: Camera, other: Camera) -> float:
    """Between the directions in which two cameras look."""
    return float(np.arccos(np.clip(one.world_from_camera[:3, 2] @ other.world_from_camera[:3, 2], -1.0, 1.0)))


def _log_luminance(linear: np.ndarray) -> float:
    return float(np.log(max(float(linear @ _LUMINANCE), _DARKEST)))

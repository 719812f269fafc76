"""An asset's pictures as the captures' camera would expose them: what a held-out photograph is compared with.

Captures of several exposures are brought to one before anything is made of them, so an asset has that one.
The camera that took them chooses its exposure by where it looks: what captures near a view had tells what it
would choose there. The view itself is not looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..captures.capture import Capture
from ..core.cameras import Camera
from ..core.colours import linear_from_srgb, srgb_from_linear
from ..splats.asset import SplatAsset
from ..splats.rendering.rasterizer import Rendering, render

_NEAREST = 0.05
"""What is added to a capture's distance, metres and radians together, so that one at the same place is not all."""


def exposures_differ(captures: Sequence[Capture]) -> bool:
    """Whether captures were brought to one exposure."""
    return any(capture.gain is not None for capture in captures)


def as_exposed(asset: SplatAsset, captures: Sequence[Capture]) -> Callable[[Camera], Rendering]:
    """Renders ``asset`` at the exposure of the ``captures`` near a camera; as it is where none has a gain."""

    def shown(camera: Camera) -> Rendering:
        rendering = render(asset, camera)
        return replace(rendering, colour=exposed(rendering.colour, camera, captures))

    return shown


def exposed(colour: np.ndarray, camera: Camera, captures: Sequence[Capture]) -> np.ndarray:
    """A picture (H, W, 3) of the captures' one exposure at that of those near its ``camera``."""
    if not exposures_differ(captures):
        return colour
    return srgb_from_linear(linear_from_srgb(colour) * exposure_near(camera, captures))


def exposure_near(camera: Camera, captures: Sequence[Capture]) -> np.ndarray:
    """(3,) float32 factors of linear red, green and blue from the captures' one exposure to that of a photograph
    taken with ``camera``.

    The geometric mean of the captures' own, weighted by the inverse square of how far they stand and look away.
    """
    apart = np.array(
        [
            np.linalg.norm(capture.camera.centre - camera.centre) + _angle_rad(capture.camera, camera)
            for capture in captures
        ]
    )
    exposures = -np.log([capture.gain or (1.0, 1.0, 1.0) for capture in captures])
    weights = (_NEAREST + apart) ** -2.0
    return np.exp(weights @ exposures / weights.sum()).astype(np.float32)


def _angle_rad(one: Camera, other: Camera) -> float:
    """Between the directions in which two cameras look."""
    return float(np.arccos(np.clip(one.world_from_camera[:3, 2] @ other.world_from_camera[:3, 2], -1.0, 1.0)))

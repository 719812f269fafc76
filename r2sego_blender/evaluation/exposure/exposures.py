"""An asset's pictures as the captures' camera would expose them: what a held-out photograph is compared with.

Captures of several exposures are brought to one before anything is made of them, so an asset has that one. What the
camera that took them would choose for a view, the captures tell (``metering``), one exposure for whatever is compared.
The view itself is not looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ...bundle.scene import Scene
from ...captures.capture import Capture
from ...captures.store import CAPTURES
from ...core.cameras import Camera
from ...core.colours import linear_from_srgb, srgb_from_linear
from ...splats.asset import SplatAsset
from ...splats.rendering.rasterizer import Rendering, render
from ..blended_captures import blended_captures
from .metering import Metering, SeenByCaptures


@dataclass(frozen=True)
class Exposures:
    """The exposures of photographs that are taken as ``captures`` were, found once a camera.

    Where no capture has a gain, everything stays as it is to the bit. ``seen`` is as for ``Metering``.
    """

    captures: Sequence[Capture]
    seen: SeenByCaptures | None = None
    _found: dict[bytes, np.ndarray] = field(default_factory=dict, repr=False, compare=False)

    @property
    def differ(self) -> bool:
        """Whether captures were brought to one exposure."""
        return any(capture.gain is not None for capture in self.captures)

    def of(self, camera: Camera) -> np.ndarray:
        """(3,) float32 factors of linear red, green and blue from the captures' one exposure to that of a photograph
        taken with ``camera``."""
        if not self.differ:
            return np.ones(3, np.float32)
        key = b"".join(array.tobytes() for array in camera.to_arrays().values())
        if key not in self._found:
            self._found[key] = np.exp(self._metering.log_exposure(camera)).astype(np.float32)
        return self._found[key]

    def exposed(self, colour: np.ndarray, camera: Camera) -> np.ndarray:
        """A picture (H, W, 3) of the captures' one exposure at that of a photograph taken with its ``camera``."""
        return srgb_from_linear(linear_from_srgb(colour) * self.of(camera)) if self.differ else colour

    def renderer(self, asset: SplatAsset) -> Callable[[Camera], Rendering]:
        """Renders ``asset`` as a camera would expose it."""

        def shown(camera: Camera) -> Rendering:
            rendering = render(asset, camera)
            return replace(rendering, colour=self.exposed(rendering.colour, camera))

        return shown

    @cached_property
    def _metering(self) -> Metering:
        return Metering(self.captures, self.seen)


def exposures_of(scene: Scene) -> Exposures:
    """How the camera of the scene's captures exposes; with the last round's proxy, of what it would look at."""
    captures = scene.read(CAPTURES)
    if not Exposures(captures).differ or (blend := blended_captures(scene)) is None:
        return Exposures(captures)
    of_holes = scene.declaration.settings.generation.hole_confidence

    def seen(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        frame = blend(camera)
        return frame.image, frame.confidence > of_holes

    return Exposures(captures, seen)

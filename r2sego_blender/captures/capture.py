"""A capture (I_i, pi_i): one registered photograph."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from ..core.cameras import Camera
from ..core.colours import linear_from_srgb, srgb_from_linear
from ..core.images import load_image, resize
from .lenses.lens import Lens


@dataclass(frozen=True)
class Capture:
    """One photograph and the calibrated camera it was taken with, in the world frame.

    ``camera`` is a pinhole at the working size. ``lens`` is what the photograph was taken
    through, if that is known to distort; ``straight`` says that the file at ``image_path``
    is already free of the distortion. ``mask_path`` is an image that says which of its pixels
    count, if there is one. ``quarter_turns`` clockwise set the pixels as taken upright. ``gain``, factors
    of red, green and blue in linear light, bring it to the exposure of all captures; None: as it is.
    ``weight`` in (0, 1] is how much it counts in blending and training: less than 1 where it is blurred.
    ``given_lens`` is what was given where the photographs said another, which the camera has.
    """

    name: str
    image_path: Path
    camera: Camera
    lens: Lens | None = None
    straight: bool = False
    mask_path: Path | None = None
    quarter_turns: int = 0
    given_lens: Lens | None = None
    gain: tuple[float, float, float] | None = None
    weight: float = 1.0

    def image(self) -> np.ndarray:
        """The undistorted photograph at its camera's size and its ``gain``, (H, W, 3) float32 in [0, 1]."""
        image = self.as_taken()
        if self.gain is None:
            return image
        return srgb_from_linear(linear_from_srgb(image) * np.array(self.gain, np.float32))

    def as_taken(self) -> np.ndarray:
        """As ``image``, at the exposure of the photograph."""
        return self.seen(load_image(self.image_path))

    def seen(self, photograph: np.ndarray) -> np.ndarray:
        """A picture (H, W) or (H, W, 3) float32 of the file's pixels as the camera sees it."""
        if self.lens is not None and not self.straight:
            twice_px = 2 * max(self.camera.width, self.camera.height)
            photograph = self.lens.straightened(photograph, twice_px)
        return resize(photograph, self.camera.width, self.camera.height)

    def working_pixels(self, pixels: np.ndarray, photograph_shape: tuple[int, int]) -> np.ndarray:
        """Pixels (n, 2) of the camera's image for pixels of the file at ``image_path``.

        ``photograph_shape`` is the (height, width) of the upright file.
        """
        pixels = np.asarray(pixels, np.float64).reshape(-1, 2)
        height, width = photograph_shape
        if self.lens is None or self.straight:
            return pixels * [self.camera.width / width, self.camera.height / height]
        rays = self.lens.scaled_to(width, height).rays(pixels)
        return rays * [self.camera.fx, self.camera.fy] + [self.camera.cx, self.camera.cy]

    @property
    def photograph_size(self) -> tuple[int, int]:
        """(width, height) of the upright photograph as taken, or of one of its shape."""
        source = self.camera if self.lens is None else self.lens
        return source.width, source.height

    def photograph_shares(self, pixels: np.ndarray) -> np.ndarray:
        """Where pixels (n, 2) of the camera's image lie on the photograph as it was taken.

        (n, 2) shares of the upright photograph's width and height, distortion included.
        """
        pixels = np.asarray(pixels, np.float64).reshape(-1, 2)
        if self.lens is not None:
            focal, centre = [self.camera.fx, self.camera.fy], [self.camera.cx, self.camera.cy]
            pixels = self.lens.project((pixels - centre) / focal)
        return pixels / self.photograph_size

    def transformed(self, similarity: np.ndarray) -> Capture:
        """This capture after a (4, 4) similarity of the world."""
        return replace(self, camera=self.camera.transformed(similarity))


@dataclass(frozen=True)
class DecodedCapture(Capture):
    """A capture that is looked at again and again: its photograph is decoded once and kept.

    What ``image`` gives is shared and must not be written to.
    """

    @staticmethod
    def of(capture: Capture) -> DecodedCapture:
        """The same capture, not decoded yet."""
        return DecodedCapture(**vars(capture))

    def image(self) -> np.ndarray:
        """See ``Capture``."""
        return self._image

    @cached_property
    def _image(self) -> np.ndarray:
        return super().image()

"""Every n-th pixel of an image, which a training step may look at in place of all of them.

An image made smaller shows what its pixels show on average, and what is learnt from it stops
short of the image. Every third pixel a side, another ninth of them each time, has a ninth of the
image's cost and is the image: its rays are the image's own, with splats as large on the screen,
so that in the mean over the ninths its loss has the whole image's gradient.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...core.cameras import Camera
from ..kernels.projection import DILATION_PX2


@dataclass(frozen=True)
class Lattice:
    """Every ``stride``-th pixel a side of an image, the first at ``row`` and ``column``."""

    stride: int = 1
    row: int = 0
    column: int = 0

    @staticmethod
    def drawn(stride: int, shape: tuple[int, int], rng: np.random.Generator) -> Lattice:
        """One of those of a ``stride`` in an image (height, width), each as likely.

        There is but one of stride 1, and nothing is drawn for it.
        """
        if stride == 1:
            return Lattice()
        return Lattice(stride, *(int(rng.integers(min(stride, side))) for side in shape))

    @property
    def dilation_px2(self) -> float:
        """What ``projection`` adds to variances in the lattice's pixels, to add the same in the image's."""
        return DILATION_PX2 / self.stride**2

    def camera(self, camera: Camera) -> Camera:
        """The camera whose pixels have the rays of this lattice's pixels in ``camera``'s image."""
        if self.stride == 1:
            return camera
        rows, columns = (range(side)[place] for side, place in zip(camera.shape, self._places, strict=True))
        return replace(
            camera,
            width=len(columns),
            height=len(rows),
            fx=camera.fx / self.stride,
            fy=camera.fy / self.stride,
            cx=(camera.cx - self.column - 0.5) / self.stride + 0.5,
            cy=(camera.cy - self.row - 0.5) / self.stride + 0.5,
        )

    def pixels(self, image: np.ndarray) -> np.ndarray:
        """Those of an image (H, W, ...), a view of it."""
        return image[self._places]

    @property
    def _places(self) -> tuple[slice, slice]:
        return slice(self.row, None, self.stride), slice(self.column, None, self.stride)

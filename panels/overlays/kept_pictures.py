"""A part of a region that is drawn once and then shown as a picture, at the cost of its pixels alone."""

import math
from collections.abc import Iterator
from contextlib import contextmanager

import gpu
from mathutils import Matrix

from .textures import draw_texture


class KeptPicture:
    """A rectangle of a region: ``left``, ``bottom``, ``width`` and ``height`` in its pixels, made whole.

    What is drawn between ``drawing()``, in the region's pixels, is what ``draw()`` shows there.
    """

    def __init__(self, left: float, bottom: float, width: float, height: float) -> None:
        left, bottom = math.floor(left), math.floor(bottom)
        self.place = left, bottom, math.ceil(width), math.ceil(height)
        # As what views are drawn into: shapes and words are blended in linear light in both.
        self._pixels = gpu.types.GPUTexture(self.place[2:], format="SRGB8_A8")
        self._drawn_into = gpu.types.GPUFrameBuffer(color_slots=self._pixels)

    @contextmanager
    def drawing(self) -> Iterator[None]:
        """Within it, all that is drawn goes into the picture, which is empty at first."""
        left, bottom, width, height = self.place
        with self._drawn_into.bind(), gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
            self._drawn_into.clear(color=(0.0, 0.0, 0.0, 0.0))
            gpu.matrix.load_matrix(Matrix.Identity(4))
            gpu.matrix.load_projection_matrix(_pixels_of(left, bottom, width, height))
            yield

    def draw(self) -> None:
        """Show it in the region, for which it was made."""
        gpu.state.blend_set("ALPHA_PREMULT")  # which colours blended over nothing are
        draw_texture(self._pixels, self.place)
        gpu.state.blend_set("NONE")


def _pixels_of(left: int, bottom: int, width: int, height: int) -> Matrix:
    """The projection that maps a rectangle of a region to all of what is drawn into."""
    return Matrix(
        (
            (2.0 / width, 0.0, 0.0, -2.0 * left / width - 1.0),
            (0.0, 2.0 / height, 0.0, -2.0 * bottom / height - 1.0),
            (0.0, 0.0, -0.01, 0.0),
            (0.0, 0.0, 0.0, 1.0),
        )
    )

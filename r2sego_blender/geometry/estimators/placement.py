"""Where a photograph lies in the picture that a model takes, and what a model says of that picture, taken back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...core.cameras import Camera
from ...core.images import resize, to_uint8

_CONTINUOUS = 1.1  # times nearer: neighbours beyond it lie on two surfaces, between which there is no depth


@dataclass(frozen=True)
class Placement:
    """A photograph, ``across`` x ``down``, in a picture of ``width`` x ``height``, its corner at ``left``, ``top``.

    All in pixels of the picture. A photograph that reaches beyond the picture is cropped, one that leaves
    some of it is padded; ``across`` and ``down`` may stretch it.
    """

    width: int
    height: int
    across: int
    down: int
    left: int = 0
    top: int = 0

    def picture(self, photograph: np.ndarray, beside: float = 1.0) -> np.ndarray:
        """(height, width, 3) uint8 of a photograph (H, W, 3) float32 in [0, 1]; ``beside`` is the padding's grey."""
        whole = to_uint8(resize(photograph, self.across, self.down))
        rows, columns = self._covered
        made = np.full((self.height, self.width, 3), round(255 * beside), np.uint8)
        made[rows, columns] = whole[
            rows.start - self.top : rows.stop - self.top, columns.start - self.left : columns.stop - self.left
        ]
        return made

    def matrix(self, camera: Camera) -> np.ndarray:
        """(3, 3) float64: the picture's intrinsics, of a photograph by ``camera``; pixel centres at half-integers."""
        matrix = camera.matrix
        matrix[0] *= self.across / camera.width
        matrix[1] *= self.down / camera.height
        matrix[:2, 2] += [self.left, self.top]
        return matrix

    def photographs(self, camera: Camera) -> Camera:
        """Its photograph's camera in as many pixels as the picture has of it, and no more than ``camera``."""
        return camera.fitted(max(self.across, self.down))

    def depth(self, said: np.ndarray, camera: Camera) -> np.ndarray:
        """Depth (H, W) float32 for each pixel of ``camera``, of planar depth (height, width) said of the picture.

        What is not above 0 and finite, cropped or beside the photograph, is 0. Inverse depth is interpolated,
        so that planes stay planes; where surfaces end the nearest pixel counts, for between them is nothing.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = np.where(np.isfinite(said) & (said > 0.0), 1.0 / said.astype(np.float64), 0.0)
        (above, low_y, share_y), (before, low_x, share_x) = self._places(camera)
        # The four around a pixel; at the photograph's border the two outermost go on.
        around = [inverse[np.ix_(low_y + y, low_x + x)] for y in (0, 1) for x in (0, 1)]
        y, x = share_y[:, None], share_x[None, :]
        between = (1 - y) * ((1 - x) * around[0] + x * around[1]) + y * ((1 - x) * around[2] + x * around[3])
        least, most = np.minimum.reduce(around), np.maximum.reduce(around)
        smooth = (least > 0.0) & (most <= _CONTINUOUS * least)
        found = np.where(smooth, between, inverse[np.ix_(above, before)])
        found *= self._inside(camera)
        return np.divide(1.0, found, out=np.zeros_like(found), where=found > 0.0).astype(np.float32)

    def nearest(self, said: np.ndarray, camera: Camera) -> np.ndarray:
        """Values (H, W) for each pixel of ``camera``, of values (height, width) of the picture; not to be mixed."""
        (rows, _, _), (columns, _, _) = self._places(camera)
        return np.ascontiguousarray(said[np.ix_(rows, columns)])

    @property
    def _covered(self) -> tuple[slice, slice]:
        """The picture's rows and columns that show the photograph."""
        return (
            slice(max(0, self.top), min(self.height, self.top + self.down)),
            slice(max(0, self.left), min(self.width, self.left + self.across)),
        )

    def _continuous(self, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """Where the rows' and columns' centres of ``camera`` lie in the picture, pixels."""
        v = self.top + (np.arange(camera.height) + 0.5) * self.down / camera.height
        u = self.left + (np.arange(camera.width) + 0.5) * self.across / camera.width
        return v, u

    def _places(self, camera: Camera) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Of rows and columns of ``camera``: the picture's pixel there, the first of two around, the second's share."""
        found = []
        for place, covered in zip(self._continuous(camera), self._covered, strict=True):
            here = np.floor(place).astype(np.int64).clip(covered.start, covered.stop - 1)
            low = np.floor(place - 0.5).astype(np.int64).clip(covered.start, max(covered.start, covered.stop - 2))
            found.append((here, low, place - 0.5 - low))
        return found

    def _inside(self, camera: Camera) -> np.ndarray:
        """(H, W) bool: which pixels of ``camera`` the picture shows."""
        v, u = self._continuous(camera)
        return ((v >= 0) & (v < self.height))[:, None] & ((u >= 0) & (u < self.width))[None, :]

"""Gaussians as the vector kernels read them: sixteen at a time, one parameter a vector.

A chunk holds sixteen Gaussians as ``rows`` vectors of sixteen floats, one for each
parameter; neighbours in space stand in one chunk, so that a camera that does not see them
skips them together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..asset import SplatAsset
from ..vector_language.aligned_memory import aligned
from ..vector_language.vectors import LANES

MEAN, LOG_SCALE, QUATERNION, LOGIT_OPACITY, HARMONICS = 0, 3, 6, 10, 11
"""First row of each parameter; harmonic k of channel c stands in row HARMONICS + 3 k + c."""

NOWHERE = -1e30
"""Opacity logit of what is never drawn, such as the places after the last Gaussian."""

_MORTON_BITS = 21


def rows_of(coefficients: int) -> int:
    """Parameters of a Gaussian with this many harmonics a channel."""
    return HARMONICS + 3 * coefficients


@dataclass
class PackedGaussians:
    """Gaussians in aligned chunks (n, rows, 16) float32, of which the first are in use.

    Place i (chunk i // 16, lane i % 16) holds the asset's Gaussian ``order[i]``, ``order``
    (N,) int64.
    """

    chunks: np.ndarray
    order: np.ndarray

    def __len__(self) -> int:
        return len(self.order)

    @property
    def values(self) -> np.ndarray:
        """The chunks in use."""
        return self.chunks[: -(-len(self) // LANES)]

    @property
    def coefficients(self) -> int:
        """Harmonics a channel."""
        return (self.chunks.shape[1] - HARMONICS) // 3

    @staticmethod
    def of(asset: SplatAsset, capacity: int = 0) -> PackedGaussians:
        """The asset's Gaussians, sorted along a space-filling curve, and room for more."""
        order = morton_order(asset.means)
        columns = np.concatenate(
            [
                asset.means,
                asset.log_scales,
                asset.quaternions,
                asset.logit_opacities[:, None],
                asset.sh.reshape(len(asset), 3 * asset.sh.shape[1]),
            ],
            axis=1,
        )
        packed = pack(columns[order])
        chunks = aligned((max(len(packed), -(-capacity // LANES)), *packed.shape[1:]))
        chunks[: len(packed)] = packed
        gaussians = PackedGaussians(chunks, order)
        gaussians.hide_rest()
        return gaussians

    def hide_rest(self) -> None:
        """Make the places after the last Gaussian such that they are never drawn."""
        chunk, lane = divmod(len(self), LANES)
        self.chunks[chunk : chunk + 1, LOGIT_OPACITY, lane:] = NOWHERE

    def asset(self) -> SplatAsset:
        """The Gaussians in the asset's own order."""
        columns = np.empty((len(self), self.chunks.shape[1]), np.float32)
        columns[self.order] = unpack(self.chunks, len(self))
        return SplatAsset(
            means=columns[:, MEAN:LOG_SCALE],
            log_scales=columns[:, LOG_SCALE:QUATERNION],
            quaternions=columns[:, QUATERNION:LOGIT_OPACITY],
            logit_opacities=columns[:, LOGIT_OPACITY],
            sh=columns[:, HARMONICS:].reshape(len(self), self.coefficients, 3),
        )


def pack(columns: np.ndarray) -> np.ndarray:
    """(N, C) as aligned chunks (ceil(N / 16), C, 16), zeros after the last row."""
    count, width = columns.shape
    chunks = aligned((-(-count // LANES), width, LANES))
    whole = count // LANES
    chunks[:whole] = columns[: whole * LANES].reshape(whole, LANES, width).transpose(0, 2, 1)
    if count % LANES:
        chunks[whole, :, : count % LANES] = columns[whole * LANES :].T
    return chunks


def unpack(chunks: np.ndarray, count: int) -> np.ndarray:
    """The first ``count`` rows (count, C) of chunks (n, C, 16)."""
    used = chunks[: -(-count // LANES)]
    return used.transpose(0, 2, 1).reshape(-1, chunks.shape[1])[:count]


def morton_order(points: np.ndarray) -> np.ndarray:
    """(N,) int64: the order of points (N, 3) along the Z curve through their bounding box.

    Points that are not finite stand as if at the box's lower corner.
    """
    if not len(points):
        return np.zeros(0, np.int64)
    points = np.asarray(points, np.float64)
    finite = np.isfinite(points).all(axis=1)
    if not finite.any():
        return np.arange(len(points), dtype=np.int64)
    # A few stray Gaussians far away must not squeeze the others into one cell.
    low, high = np.percentile(points[finite], [1.0, 99.0], axis=0)
    size = float((high - low).max()) or 1.0
    inside = np.clip((np.where(finite[:, None], points, low) - low) / size, 0.0, 1.0)
    cells = (inside * (2**_MORTON_BITS - 1)).astype(np.uint64)
    code = np.zeros(len(points), np.uint64)
    for axis in range(3):
        code |= _spread_bits(cells[:, axis]) << np.uint64(axis)
    return np.argsort(code, kind="stable")


def _spread_bits(cells: np.ndarray) -> np.ndarray:
    """Two zero bits put between neighbouring ones of the 21 low bits."""
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        cells = (cells | (cells << np.uint64(shift))) & np.uint64(mask)
    return cells

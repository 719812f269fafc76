"""How much there is to blend: every pair of a pixel and a Gaussian that contributes to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..splats.binning import BLOCK_PX, BLOCKS_A_SIDE, TILE_PX
from ..splats.compiled import kernel
from ..splats.projection import (
    EIGHTH,
    EIGHTH_SMALLEST,
    FACTOR_A,
    FACTOR_B,
    FACTOR_C,
    LARGEST_ALPHA,
    U,
    V,
)
from ..splats.rasterizer import TileEntries

_FINISHED = 1e-4
"""3DGS: behind this transmittance a pixel takes no Gaussian any more."""

_GAUSSIAN = 2  # place of the Gaussian's number in an entry's four int32, after its blocks' 64 bits


@dataclass(frozen=True)
class Work:
    """What one image takes.

    ``visible`` Gaussians touch a block of it, ``contributing`` ones are seen in a pixel at
    least; ``pairs`` of a pixel and a Gaussian have alpha >= 1/255 there and a transmittance
    above 1e-4 before it.
    """

    visible: int
    contributing: int
    pairs: int


def count_work(found: TileEntries, shape: tuple[int, int]) -> Work:
    """Count what the rasteriser's entries make of an image of ``shape`` (height, width)."""
    touches, contributes = np.zeros((2, len(found.records)), bool)
    pairs = _count_pairs(
        found.records, found.entries, found.entries.view(np.int64), found.order, found.starts,
        found.tiles_x, *shape, touches, contributes,
    )  # fmt: skip
    return Work(int(touches.sum()), int(contributes.sum()), int(pairs))


@kernel
def _count_pairs(records, entries, blocks, order, tile_starts, tiles_x, height, width, touches, contributes):
    """The pairs of all tiles; ``touches`` and ``contributes`` (records,) bool are set for Gaussians."""
    pairs = 0
    transmittance = np.empty((TILE_PX, TILE_PX), np.float32)
    for tile in range(tile_starts.shape[0] - 1):
        transmittance[:] = 1.0
        left, top = tile % tiles_x * TILE_PX, tile // tiles_x * TILE_PX
        rows, columns = min(TILE_PX, height - top), min(TILE_PX, width - left)
        for place in range(tile_starts[tile], tile_starts[tile + 1]):
            entry = order[place] & np.uint64(0xFFFFFFFF)
            touched, gaussian = blocks[entry, 0], entries[entry, _GAUSSIAN]
            record = records[gaussian]
            touches[gaussian] = True
            for block in range(BLOCKS_A_SIDE * BLOCKS_A_SIDE):
                if not (touched >> block) & 1:
                    continue
                x, y = block % BLOCKS_A_SIDE * BLOCK_PX, block // BLOCKS_A_SIDE * BLOCK_PX
                for row in range(y, min(y + BLOCK_PX, rows)):
                    f = record[FACTOR_C] * (top + row + np.float32(0.5) - record[V])
                    along = record[FACTOR_B] * (top + row + np.float32(0.5) - record[V])
                    for column in range(x, min(x + BLOCK_PX, columns)):
                        e = record[FACTOR_A] * (left + column + np.float32(0.5) - record[U]) + along
                        eighth = record[EIGHTH] - e * e - f * f
                        before = transmittance[row, column]
                        if eighth >= EIGHTH_SMALLEST and before > _FINISHED:
                            alpha = min(2.0 ** (8.0 * eighth), LARGEST_ALPHA)
                            transmittance[row, column] = before * (1.0 - alpha)
                            contributes[gaussian] = True
                            pairs += 1
    return pairs

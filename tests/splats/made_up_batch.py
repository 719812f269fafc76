"""A made-up batch: Gaussians around a tile, entries that name them, and where the tile's pixels are."""

from __future__ import annotations

import numpy as np

from r2sego_blender.splats.kernels.binning import ENTRY_BYTES
from r2sego_blender.splats.kernels.projection import FACTOR_A, FACTOR_B, FACTOR_C, U, V
from r2sego_blender.splats.kernels.tiles import BLOCK_PX, BLOCKS, BLOCKS_A_SIDE, TILE_PX
from r2sego_blender.splats.vector_language.aligned_memory import aligned
from r2sego_blender.splats.vector_language.vectors import LANES

GAUSSIANS, ENTRIES = 50, 90
MIDDLE = (3 * TILE_PX + TILE_PX // 2, 7 * TILE_PX + TILE_PX // 2)


def made_up_records(rng: np.random.Generator) -> np.ndarray:
    """Gaussians around the tile, from a pixel to a tile wide."""
    records = aligned((GAUSSIANS, LANES))
    records[:] = rng.normal(size=records.shape)
    for field, middle in zip((U, V), MIDDLE, strict=True):
        records[:, field] = middle + rng.uniform(-TILE_PX, TILE_PX, GAUSSIANS)
    for field in (FACTOR_A, FACTOR_B, FACTOR_C):
        records[:, field] = rng.normal(size=GAUSSIANS) / rng.uniform(1.0, TILE_PX, GAUSSIANS)
    return records


def made_up_entries(rng: np.random.Generator) -> np.ndarray:
    assert ENTRY_BYTES == 16
    entries = np.zeros(ENTRIES, [("blocks", np.int64), ("gaussian", np.int32), ("tile", np.int32)])
    entries["blocks"] = rng.integers(-(2**63), 2**63 - 1, ENTRIES)
    entries["gaussian"] = rng.integers(0, GAUSSIANS, ENTRIES)
    entries["tile"] = 7
    return entries


def pixel_centres() -> tuple[np.ndarray, np.ndarray]:
    """x and y (64, 16) of the blocks' pixels in the image."""
    block, lane = np.arange(BLOCKS)[:, None], np.arange(LANES)
    x = MIDDLE[0] - TILE_PX / 2 + BLOCK_PX * (block % BLOCKS_A_SIDE) + lane % BLOCK_PX + 0.5
    y = MIDDLE[1] - TILE_PX / 2 + BLOCK_PX * (block // BLOCKS_A_SIDE) + lane // BLOCK_PX + 0.5
    return x, y

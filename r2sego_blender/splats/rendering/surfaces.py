"""Opaque surfaces among the Gaussians: what of the asset stands in front of them, and how much light it lets through.

A surface is cut into the asset where the rasteriser sorts Gaussians, by the planar depth of their
centres: those nearer than it are blended as ever, the light they leave is the surface's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kernels.blending import FINISHED
from ..kernels.compiled import parallel_kernel, prange
from ..kernels.projection import BLUE, DEPTH, GREEN, RED, U, V
from ..kernels.tiles import BLOCK_PX, BLOCKS, BLOCKS_A_SIDE, TILE_PX
from ..vector_language.vectors import LANES
from .outputs import block_weights
from .rasterizer import TileEntries

_FINISHED = np.float32(FINISHED)
_OPEN, _SHUT = np.float32(1.0), np.float32(0.0)
_MIDDLE = np.float32(TILE_PX / 2 - 0.5)
_COLUMNS, _ROWS = (axis(np.arange(LANES), BLOCK_PX).astype(np.float32) for axis in (np.mod, np.floor_divide))


@dataclass(frozen=True)
class InFront:
    """What the Gaussians before a surface show: float32 arrays of the image's size, 0 where there is no surface.

    ``colour`` (H, W, 3) and ``depth_sum`` (H, W) metres are sums by weight, ``transmittance``
    (H, W) the share of the surface's light that arrives.
    """

    colour: np.ndarray
    depth_sum: np.ndarray
    transmittance: np.ndarray


def in_front(tiles: TileEntries, surface_m: np.ndarray) -> InFront:
    """Of the rasteriser's last image what is nearer than ``surface_m`` (H, W), planar depths; 0 for no surface."""
    surface_m = np.ascontiguousarray(surface_m, np.float32)
    sums = np.zeros((*surface_m.shape, 5), np.float32)
    _blend_before(tiles.records, tiles.entries, tiles.order, tiles.starts, tiles.tiles_x, surface_m, sums)
    return InFront(sums[..., :3], sums[..., 3], sums[..., 4])


@parallel_kernel
def _blend_before(records, entries, order, starts, tiles_x, surface_m, sums):
    """Fill ``sums`` (H, W, 5): red, green, blue, depth and transmittance before the surfaces."""
    height, width = surface_m.shape
    for tile in prange(len(starts) - 1):
        tile_x, tile_y = tile % tiles_x * TILE_PX, tile // tiles_x * TILE_PX
        transmittance, weights = np.empty(LANES, np.float32), np.empty(LANES, np.float32)
        surface, light = np.empty(LANES, np.float32), np.empty(LANES, np.float32)
        total = np.empty((4, LANES), np.float32)
        for block in range(BLOCKS):
            x, y = block % BLOCKS_A_SIDE * BLOCK_PX, block // BLOCKS_A_SIDE * BLOCK_PX
            farthest = np.float32(0.0)
            for lane in range(LANES):
                column, row = tile_x + x + lane % BLOCK_PX, tile_y + y + lane // BLOCK_PX
                surface[lane] = surface_m[row, column] if column < width and row < height else _SHUT
                transmittance[lane] = _OPEN if surface[lane] > 0.0 else _SHUT
                farthest = max(farthest, surface[lane])
            if farthest == 0.0:
                continue
            light[:] = 0.0
            total[:] = 0.0
            for k in range(starts[tile], starts[tile + 1]):
                entry = entries[order[k] & np.uint64(0xFFFFFFFF)]
                half = entry[block >> 5]
                if not half >> (block & 31) & 1:
                    continue
                record = records[entry[2]]
                depth = record[DEPTH]
                if depth >= farthest:
                    break
                brightest = np.float32(0.0)
                for lane in range(LANES):
                    if depth >= surface[lane]:  # from here on the surface hides what comes
                        light[lane] = max(light[lane], transmittance[lane])
                        transmittance[lane] = 0.0
                    brightest = max(brightest, transmittance[lane])
                if brightest <= _FINISHED:
                    break
                # From the tile's middle: far from the image's corner digits would be lost.
                left = np.float32(x) - _MIDDLE - (record[U] - np.float32(tile_x + TILE_PX // 2))
                top = np.float32(y) - _MIDDLE - (record[V] - np.float32(tile_y + TILE_PX // 2))
                block_weights(record, left, top, _COLUMNS, _ROWS, transmittance, weights)
                for lane in range(LANES):
                    total[0, lane] += weights[lane] * record[RED]
                    total[1, lane] += weights[lane] * record[GREEN]
                    total[2, lane] += weights[lane] * record[BLUE]
                    total[3, lane] += weights[lane] * depth
            for lane in range(LANES):
                if surface[lane] > 0.0:
                    column, row = tile_x + x + lane % BLOCK_PX, tile_y + y + lane // BLOCK_PX
                    for channel in range(4):
                        sums[row, column, channel] = total[channel, lane]
                    sums[row, column, 4] = max(light[lane], transmittance[lane])

"""How much there is to blend: every pair of a pixel and a Gaussian that contributes to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2sego_blender.splats.rendering.outputs import pixel_counts
from r2sego_blender.splats.rendering.rasterizer import TileEntries

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
    pixels = pixel_counts(found, shape)
    touching = found.entries[found.order & np.uint64(0xFFFFFFFF), _GAUSSIAN]
    return Work(len(np.unique(touching)), int((pixels > 0).sum()), int(pixels.sum()))

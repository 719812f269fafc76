"""Pictures side by side in one, each with its words above it. NumPy alone; no bpy."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...geometry.proxy.proxy import PROVENANCE_COLOURS, Provenance
from .view_labels import draw_text

_GAP_PX, _TEXT_SCALE = 8, 2
_LABEL_PX = 5 * _TEXT_SCALE + 8
_BACKGROUND, _TEXT = 38, 235
_MILLIMETRE_LEVELS = 65535.0


def side_by_side(pictures: Sequence[tuple[str, np.ndarray]], cell: tuple[int, int], columns: int = 0) -> np.ndarray:
    """(H, W, 3) uint8: labelled pictures (h, w, 3) uint8 in a grid of cells (height, width).

    A picture keeps its proportions. ``columns`` 0 makes the grid a little wider than high.
    Raises ValueError without any picture.
    """
    if not pictures:
        raise ValueError("there is no picture to show")
    columns = min(len(pictures), columns or math.ceil(math.sqrt(1.6 * len(pictures))))
    rows = math.ceil(len(pictures) / columns)
    height, width = cell
    step = (height + _LABEL_PX + _GAP_PX, width + _GAP_PX)
    grid = np.full((rows * step[0] + _GAP_PX, columns * step[1] + _GAP_PX, 3), _BACKGROUND, np.uint8)
    for place, (label, picture) in enumerate(pictures):
        top, left = _GAP_PX + place // columns * step[0], _GAP_PX + place % columns * step[1]
        draw_text(grid[:, : left + width], label, left, top + 2, _TEXT_SCALE, _TEXT)
        grid[top + _LABEL_PX : top + _LABEL_PX + height, left : left + width] = fitted(picture, cell)
    return grid


def fitted(picture: np.ndarray, cell: tuple[int, int]) -> np.ndarray:
    """(height, width, 3): the picture in the middle of a black cell, as large as it goes."""
    height, width = picture.shape[:2]
    scale = min(cell[0] / height, cell[1] / width)
    size = max(1, round(height * scale)), max(1, round(width * scale))
    rows = np.minimum(((np.arange(size[0]) + 0.5) / scale).astype(int), height - 1)
    columns = np.minimum(((np.arange(size[1]) + 0.5) / scale).astype(int), width - 1)
    framed = np.zeros((*cell, 3), picture.dtype)
    top, left = (cell[0] - size[0]) // 2, (cell[1] - size[1]) // 2
    framed[top : top + size[0], left : left + size[1]] = picture[rows][:, columns]
    return framed


def shaded_depth(levels: np.ndarray) -> np.ndarray:
    """(H, W, 3) uint8: depth (H, W), 0 = nothing, from the nearest, light, to the farthest, dark."""
    seen = levels > 0
    if not seen.any():
        return np.zeros((*levels.shape, 3), np.uint8)
    near, far = float(levels[seen].min()), float(levels[seen].max())
    share = (levels - near) / max(far - near, 1e-9)
    grey = np.where(seen, 255.0 - 215.0 * share, 0.0).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)


def coloured_provenance(kinds: np.ndarray) -> np.ndarray:
    """(H, W, 3) uint8: 0 nothing, black, else ``Provenance`` + 1 in its colour."""
    table = np.zeros((len(Provenance) + 1, 3))
    for kind in Provenance:
        table[kind + 1] = PROVENANCE_COLOURS[kind]
    return (255.0 * table[np.minimum(kinds, len(Provenance))]).astype(np.uint8)


def depth_range_m(levels: np.ndarray) -> tuple[float, float]:
    """The nearest and the farthest depth, metres, of 16-bit millimetres as shares of 65,535."""
    seen = levels[levels > 0]
    if not len(seen):
        return 0.0, 0.0
    near, far = (float(value) * _MILLIMETRE_LEVELS / 1000.0 for value in (seen.min(), seen.max()))
    return near, far

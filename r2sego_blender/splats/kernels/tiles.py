"""A tile's state while its Gaussians are blended, and its way from and to the image.

A tile has 32 x 32 pixels, 64 blocks of 4 x 4: a block's pixels are the sixteen lanes of a
vector. The state holds for each block six vectors: the transmittances, and what is summed
(forward: red, green, blue and depth; backward: the rest, and the image's gradients in
those four).

An image is stored as *planes* of whole tiles, one for each channel. Four blocks side by
side are four rows of sixteen pixels: one is made of the other by exchanging quarters.
"""

from __future__ import annotations

import itertools

import numpy as np
from numba.core.types import int64, void

from ..vector_language.aligned_memory import aligned
from ..vector_language.lanes import quarters_exchanged
from ..vector_language.vectors import LANES, VECTOR_BYTES, Code, Value, vector_kernel

TILE_SHIFT = 5
TILE_PX = 1 << TILE_SHIFT
SIDE_SHIFT = 3
BLOCKS_A_SIDE = 1 << SIDE_SHIFT
BLOCK_PX = TILE_PX // BLOCKS_A_SIDE
RUN_OF_TILES = 5  # side by side, for one thread: neighbours share Gaussians
BLOCKS = BLOCKS_A_SIDE**2

TRANSMITTANCE, SUMS = 0, 1
REST, UPSTREAM = 1, 2
"""Places in a block's state; of SUMS four, of UPSTREAM four. Forward and backward share it."""

BLOCK_BYTES = 7 * VECTOR_BYTES
"""From a block to the next: six vectors, and one left free. With an odd number no two blocks are
whole 4 KiB apart, where processors take a load for one of what was just stored."""

STATE_BYTES = BLOCKS * BLOCK_BYTES

TRANSMITTANCE_PLANE, DEPTH_PLANE, IMAGE_PLANES = 3, 4, 5
"""An image's planes after red, green and blue."""

_ROW_BYTES = BLOCKS_A_SIDE * BLOCK_BYTES
_GROUP = 4  # blocks side by side that are exchanged with rows
_GROUPS_A_ROW = BLOCKS_A_SIDE // _GROUP


def planes_of(image: np.ndarray) -> np.ndarray:
    """An image (H, W, C), or (H, W), as aligned float32 planes (C, H', W') of whole tiles, zeros outside.

    One of uint8 has 255 where another has 1.
    """
    image = image[..., None] if image.ndim == 2 else image
    height, width, channels = image.shape
    planes = aligned((channels, -(-height // TILE_PX) * TILE_PX, -(-width // TILE_PX) * TILE_PX))
    inside, channels_first = planes[:, :height, :width], np.moveaxis(image, 2, 0)
    if image.dtype == np.uint8:
        np.divide(channels_first, np.float32(255.0), out=inside, dtype=np.float32)
    else:
        inside[...] = channels_first
    return planes


@vector_kernel(void(int64))
def open_tile(code: Code, state: Value) -> None:
    """Nothing blended yet: all light comes through."""
    with code.loop(code.long(BLOCKS)) as block:
        place = state + block * BLOCK_BYTES
        code.store(place, code.vector(1.0))
        for k in range(4):
            code.store(place + (SUMS + k) * VECTOR_BYTES, code.vector(0.0))


class _Group:
    """Four blocks side by side: ``block`` places in the state, ``row`` addresses in a plane."""

    def __init__(self, code: Code, state: Value, number: Value) -> None:
        self.code = code
        self._row, self._column = number >> 1, number & (_GROUPS_A_ROW - 1)
        self._state = state + self._row * _ROW_BYTES + self._column * (_GROUP * BLOCK_BYTES)

    def blocks(self, place: int) -> list[Value]:
        """Where the blocks' vectors stand."""
        return [self._state + (block * BLOCK_BYTES + place * VECTOR_BYTES) for block in range(_GROUP)]

    def rows(self, corner: Value, pitch: Value, step: Value | int = VECTOR_BYTES) -> list[Value]:
        """Where the rows stand in a plane, from where the tile stands and the bytes from row to row."""
        first = corner + self._row * BLOCK_PX * pitch + self._column * step
        return [first + pitch * row for row in range(BLOCK_PX)]

    def load_blocks(self, place: int) -> list[Value]:
        """The blocks' vectors, as rows."""
        return quarters_exchanged([self.code.load(at) for at in self.blocks(place)])

    def store_blocks(self, place: int, rows: list[Value]) -> None:
        """The reverse."""
        for at, vector in zip(self.blocks(place), quarters_exchanged(rows), strict=True):
            self.code.store(at, vector)


@vector_kernel(void(int64, int64, int64, int64, int64))
def ask_for_rows(code: Code, planes: Value, plane_bytes: Value, pitch: Value, count: Value, row: Value) -> None:
    """Have four rows, of ``count`` planes from the first, in the cache when ``store_tile`` writes them.

    ``planes`` is where the tile begins in the first plane. A few rows at a time: the
    processor waits when it is asked for too much at once.
    """
    first = planes + row * pitch
    with code.loop(count) as plane:
        for k, column in itertools.product(range(BLOCK_PX), range(0, TILE_PX, LANES)):
            code.prefetch(first + plane * plane_bytes + pitch * k + 4 * column, write=True)


@vector_kernel(void(int64, int64, int64, int64, int64, int64, int64, int64, int64))
def store_tile(
    code: Code,
    state: Value,
    planes: Value,
    plane_bytes: Value,
    pitch: Value,
    background: Value,
    background_plane_bytes: Value,
    background_pitch: Value,
    background_step: Value,
    with_depth: Value,
) -> None:
    """Put the sums over the background into the image's planes.

    ``planes`` and ``background`` are where the tile begins in the first plane; ``pitch`` are
    bytes from row to row, ``background_step`` from sixteen pixels to the next: one colour is
    an image whose steps are 0.
    """
    with code.loop(code.long(BLOCKS // _GROUP)) as number:
        group = _Group(code, state, number)
        transmittance = group.load_blocks(TRANSMITTANCE)
        for k in range(3):
            behind = group.rows(background + background_plane_bytes * k, background_pitch, background_step)
            targets = group.rows(planes + plane_bytes * k, pitch)
            for index, colour in enumerate(group.load_blocks(SUMS + k)):
                code.store(targets[index], code.fma(transmittance[index], code.load(behind[index]), colour))
        for at, row in zip(group.rows(planes + plane_bytes * TRANSMITTANCE_PLANE, pitch), transmittance, strict=True):
            code.store(at, row)
        with code.when(with_depth.differs(0)):
            depth = group.load_blocks(SUMS + 3)
            for at, row in zip(group.rows(planes + plane_bytes * DEPTH_PLANE, pitch), depth, strict=True):
                code.store(at, row)


@vector_kernel(void(int64, int64, int64, int64, int64, int64, int64))
def open_gradient(
    code: Code,
    state: Value,
    planes: Value,
    gradients: Value,
    plane_bytes: Value,
    pitch: Value,
    with_alpha: Value,
    with_depth: Value,
) -> None:
    """Before the first Gaussian: the image's gradients, and as the rest all that was blended.

    ``planes`` and ``gradients`` are where the tile begins in the first plane of the image and
    of its gradient.
    """
    with code.loop(code.long(BLOCKS // _GROUP)) as number:
        group = _Group(code, state, number)
        rest = [code.variable(code.vector(0.0)) for _ in range(BLOCK_PX)]

        def add(plane: int, sign: float, group: _Group = group, rest: list = rest) -> list[Value]:
            """The gradient's rows in a plane, whose product with the image's joins the rest."""
            upstream = [code.load(at) for at in group.rows(gradients + plane_bytes * plane, pitch)]
            images = [code.load(at) for at in group.rows(planes + plane_bytes * plane, pitch)]
            for total, g, image in zip(rest, upstream, images, strict=True):
                total.set(code.fma(g * sign, image, total.get()))
            return upstream

        for k in range(3):
            group.store_blocks(UPSTREAM + k, add(k, 1.0))
        with code.when(with_depth.differs(0)):
            group.store_blocks(UPSTREAM + 3, add(DEPTH_PLANE, 1.0))
        with code.when(with_alpha.differs(0)):
            add(TRANSMITTANCE_PLANE, -1.0)
        group.store_blocks(REST, [row.get() for row in rest])
    with code.loop(code.long(BLOCKS)) as block:
        code.store(state + block * BLOCK_BYTES, code.vector(1.0))


def open_blocks(code: Code, state: Value, finished: float) -> Value:
    """The blocks with a transmittance above ``finished``, as bits."""
    alive = code.variable(code.long(0))
    with code.loop(code.long(BLOCKS)) as block:
        open_ = code.bits(code.load(state + block * BLOCK_BYTES) > finished).differs(0)
        alive.set(alive.get() | (code.select(open_, code.long(1), code.long(0)) << block))
    return alive.get()

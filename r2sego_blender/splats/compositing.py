"""Front-to-back compositing of a tile's Gaussians, and its gradient.

A tile's state has for each of its 64 blocks one vector of transmittances, then vectors of
what is summed. Each entry visits the blocks it touches. A pixel is finished when its transmittance
falls to ``FINISHED`` or below and a block when all its pixels are; the tile ends with
its last block. The gradient visits the entries in the same order again: with the
transmittance T in front of it, a Gaussian's alpha has the gradient

    T (shade - rest / T'),

where T' is the transmittance behind it, shade the product of its colour and the image's
gradient, and rest what the Gaussians behind it and the background add to the product of
image and gradient; so nothing need be stored for each pixel and Gaussian.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numba import get_thread_id
from numba.core.types import float32, int64, void

from .binning import BLOCK_PX, BLOCKS_A_SIDE, ENTRY_BYTES, TILE_PX
from .compiled import kernel, parallel_kernel, prange
from .projection import (
    DEPTH,
    EIGHTH,
    EIGHTH_SMALLEST,
    FACTOR_A,
    FACTOR_B,
    FACTOR_C,
    LARGEST_ALPHA,
    RECORD_BYTES,
    RED,
    U,
    V,
)
from .vectors import (
    EXP2_COEFFICIENTS_BELOW_0,
    LANES,
    VECTOR_BYTES,
    Code,
    Value,
    Variable,
    aligned,
    flush_denormals,
    restore_denormals,
    vector_kernel,
)

_BLOCKS = BLOCKS_A_SIDE**2
_PLANES = 9
_BLOCK_BYTES = _PLANES * VECTOR_BYTES  # block by block: planes 4096 bytes apart would alias in the cache
STATE_BYTES = _BLOCKS * _BLOCK_BYTES
_TRANSMITTANCE, _SUMS = 0, 1  # forward: red, green, blue and depth
_REST, _UPSTREAM = 1, 2  # backward: the gradients of red, green, blue and depth
_X, _Y, _SPARE = 6, 7, 8  # pixel centres, from the tile's middle

BATCH = 32
"""Entries whose records are fetched together; after each batch finished blocks are noticed."""

SLOT_BYTES = VECTOR_BYTES
"""An entry's gradient sums: of g = alpha dL/dalpha the moments 1, e, f, e e, e f and x, the
exponent's eighth, from which f f follows (x = eighth - e e - f f); the gradients of red, green, blue and depth; then 1 if the entry was blended."""
MOMENTS, BLENDED = 10, 10

FINISHED = 1e-4
"""A pixel whose transmittance is not above this takes no more Gaussians."""

_MASK_BYTES = 8
_EIGHTH_LARGEST = math.log2(LARGEST_ALPHA) / 8.0

TRANSMITTANCE_PLANE, DEPTH_PLANE, IMAGE_PLANES = 3, 4, 5
"""An image's planes after red, green and blue."""

SCRATCH_BYTES = STATE_BYTES + BATCH * (RECORD_BYTES + _MASK_BYTES)
"""What a thread needs: the planes, a batch of records, and their blocks."""


_CONSTANTS = (*EXP2_COEFFICIENTS_BELOW_0, LARGEST_ALPHA, EIGHTH_SMALLEST, _EIGHTH_LARGEST, FINISHED)
_LARGEST, _EIGHTH_SMALLEST_AT, _EIGHTH_LARGEST_AT, _FINISHED_AT = range(6, 10)


def _table() -> np.ndarray:
    """(1 + 128, 16): the constants; the blocks' pixel centres x and y from the tile's middle.

    The constants stand in memory, so that vector registers are left for the sums.
    """
    lane, block = np.arange(LANES), np.arange(_BLOCKS)[:, None]
    table = aligned((1 + 2 * _BLOCKS, LANES))
    table[0, : len(_CONSTANTS)] = _CONSTANTS
    middle = TILE_PX / 2 - 0.5
    table[1 : 1 + _BLOCKS] = BLOCK_PX * (block % BLOCKS_A_SIDE) + lane % BLOCK_PX - middle
    table[1 + _BLOCKS :] = BLOCK_PX * (block // BLOCKS_A_SIDE) + lane // BLOCK_PX - middle
    return table


TABLE = _table()
_COORDINATES_BYTES = _BLOCKS * VECTOR_BYTES


@vector_kernel(void(int64, int64, int64, int64, int64, int64, int64, int64))
def _fetch(
    code: Code, order: Value, count: Value, entries: Value, records: Value, middle_x: Value, middle_y: Value,
    batch: Value, masks: Value,
) -> None:  # fmt: skip
    """Copy the next entries' records and blocks; U and V become the constants of e and f."""
    x, y = code.to_floats(middle_x), code.to_floats(middle_y)
    with code.loop(count) as i:
        entry = entries + (code.load_long(order + 8 * i) & 0xFFFFFFFF) * ENTRY_BYTES
        code.store_long(masks + 8 * i, code.load_long(entry))
        source = records + code.load_int(entry + 8) * RECORD_BYTES
        target = batch + i * RECORD_BYTES
        code.store(target, code.load(source))
        from_u, from_v = (code.load_float(source + 4 * k) - m for k, m in ((U, x), (V, y)))
        a, b, c = (code.load_float(source + 4 * k) for k in (FACTOR_A, FACTOR_B, FACTOR_C))
        code.store_float(target + 4 * U, -(a * from_u + b * from_v))
        code.store_float(target + 4 * V, -(c * from_v))


class _Splat:
    """A fetched record and its alpha at a block."""

    def __init__(self, code: Code, state: Value, table: Value, record: Value, depth: bool) -> None:
        def field(place: int) -> Value:
            return code.spread(code.load_float(record + 4 * place))

        self.code, self.state, self.table = code, state, table
        self.opacity_eighth = code.load_float(record + 4 * EIGHTH)
        self.e0, self.f0 = field(U), field(V)
        self.a, self.b, self.c, self.eighth = map(field, (FACTOR_A, FACTOR_B, FACTOR_C, EIGHTH))
        self.colour = [field(RED + k) for k in range(3)] + ([field(DEPTH)] if depth else [])

    def constant(self, place: int) -> Value:
        return self.code.spread(self.code.load_float(self.table + 4 * place))

    def visit(self, blocks: Value, blend: Callable[[Value, bool, list[Value]], None]) -> None:
        """``blend(state, held, shape)`` for each block's state, with the splat's ``shape`` there.

        The next block's shape is computed beside the blending of this one: one after the other
        is a chain of operations longer than processors look ahead.
        """
        code = self.code
        # Most Gaussians need not be held.
        can_be_large = self.opacity_eighth >= code.float(_EIGHTH_LARGEST)
        for held, condition in ((True, can_be_large), (False, can_be_large.equals(False))):
            with code.when(condition), code.when(blocks.differs(0)):
                place = code.variable(self._place(blocks))
                shape = [code.variable(x) for x in self._shape(place.get(), held)]
                rest = code.variable(blocks & (blocks - 1))
                with code.loop_while(lambda: rest.get().differs(0)):
                    here, ahead = place.get(), self._place(rest.get())
                    now, then = [x.get() for x in shape], self._shape(ahead, held)
                    blend(here, held, now)
                    rest.set(rest.get() & (rest.get() - 1))
                    place.set(ahead)
                    for variable, value in zip(shape, then, strict=True):
                        variable.set(value)
                blend(place.get(), held, [x.get() for x in shape])

    def _place(self, blocks: Value) -> Value:
        """The state of the first of some blocks."""
        return self.state + self.code.trailing_zeros(blocks) * _BLOCK_BYTES

    def _shape(self, place: Value, held: bool) -> list[Value]:
        """alpha, 0 where it is below 1/255; then e, f and the exponent's eighth.

        Only where ``held`` alpha can pass 0.99 and is held there.
        """
        code = self.code
        x, y = (code.load(place + plane * VECTOR_BYTES) for plane in (_X, _Y))
        e = code.fma(self.a, x, code.fma(self.b, y, self.e0))
        f = code.fma(self.c, y, self.f0)
        exponent = code.fma(-e, e, code.fma(-f, f, self.eighth))
        alpha = code.exp2_small(exponent, [self.constant(k) for k in range(6)])
        if held:
            alpha = code.minimum(alpha, self.constant(_LARGEST))
        alpha = code.select(exponent >= self.constant(_EIGHTH_SMALLEST_AT), alpha, 0.0)
        return [alpha, e, f, exponent]

    def weight(self, alpha: Value, transmittance: Value) -> Value:
        """What a pixel takes of the splat: nothing if it is finished."""
        open_ = transmittance > self.constant(_FINISHED_AT)
        return self.code.select(open_, alpha * transmittance, 0.0)


def _write_blend(code: Code, depth: bool, *arguments: Value) -> None:
    state, table, batch, masks, count, alive = arguments
    with code.loop(count) as i:
        splat = _Splat(code, state, table, batch + i * RECORD_BYTES, depth)

        def blend(place: Value, held: bool, shape: list[Value], splat: _Splat = splat) -> None:
            transmittance = code.load(place)
            weight = splat.weight(shape[0], transmittance)
            code.store(place, transmittance - weight)
            for k, colour in enumerate(splat.colour):
                at = place + (_SUMS + k) * VECTOR_BYTES
                code.store(at, code.fma(weight, colour, code.load(at)))

        splat.visit(code.load_long(masks + 8 * i) & alive, blend)


def _write_blend_backward(code: Code, depth: bool, *arguments: Value) -> None:
    state, table, batch, masks, count, alive, order, slots = arguments
    channels = 4 if depth else 3
    zero = code.vector(0.0)
    with code.loop(count) as i:
        splat = _Splat(code, state, table, batch + i * RECORD_BYTES, depth)
        sums = [code.variable(zero) for _ in range(6 + channels)]

        def blend(
            place: Value, held: bool, shape: list[Value], splat: _Splat = splat, sums: list[Variable] = sums
        ) -> None:
            alpha, e, f, exponent = shape
            transmittance = code.load(place)
            weight = splat.weight(alpha, transmittance)
            behind = transmittance - weight
            code.store(place, behind)
            upstream = [code.load(place + (_UPSTREAM + k) * VECTOR_BYTES) for k in range(channels)]
            shade = upstream[0] * splat.colour[0]
            for g, colour in zip(upstream[1:], splat.colour[1:], strict=True):
                shade = code.fma(g, colour, shade)
            rest = code.fma(-weight, shade, code.load(place + _REST * VECTOR_BYTES))
            code.store(place + _REST * VECTOR_BYTES, rest)
            gradient = weight * code.fma(-rest, code.quotient(1.0, behind), shade)
            if held:
                gradient = code.select(exponent < splat.constant(_EIGHTH_LARGEST_AT), gradient, 0.0)
            along_e = gradient * e
            sums[0].add(gradient)
            sums[1].add(along_e)
            products = [(gradient, f), (along_e, e), (along_e, f), (gradient, exponent)]
            products += [(weight, g) for g in upstream]
            for total, (a, b) in zip(sums[2:], products, strict=True):
                total.set(code.fma(a, b, total.get()))

        blocks = code.load_long(masks + 8 * i) & alive
        splat.visit(blocks, blend)
        entry = code.load_long(order + 8 * i) & 0xFFFFFFFF
        slot = slots + entry * SLOT_BYTES
        code.store(slot, code.sums([total.get() for total in sums]))
        if not depth:
            code.store_float(slot + 4 * (MOMENTS - 1), code.float(0.0))
        code.store_float(slot + 4 * BLENDED, code.select(blocks.differs(0), code.float(1.0), code.float(0.0)))


_BLEND = void(int64, int64, int64, int64, int64, int64)
_BLEND_BACKWARD = void(int64, int64, int64, int64, int64, int64, int64, int64)


@vector_kernel(_BLEND)
def _blend(code, state, table, batch, masks, count, alive):
    """Put a batch of Gaussians behind what the blocks already have."""
    _write_blend(code, False, state, table, batch, masks, count, alive)


@vector_kernel(_BLEND)
def _blend_with_depth(code, state, table, batch, masks, count, alive):
    """The same, and the sum of weight * depth."""
    _write_blend(code, True, state, table, batch, masks, count, alive)


@vector_kernel(_BLEND_BACKWARD)
def _blend_backward(code, state, table, batch, masks, count, alive, order, slots):
    """Replay ``_blend`` and fill the entries' slots."""
    _write_blend_backward(code, False, state, table, batch, masks, count, alive, order, slots)


@vector_kernel(_BLEND_BACKWARD)
def _blend_backward_with_depth(code, state, table, batch, masks, count, alive, order, slots):
    """Replay ``_blend_with_depth`` and fill the entries' slots."""
    _write_blend_backward(code, True, state, table, batch, masks, count, alive, order, slots)


@vector_kernel(int64(int64))
def _unfinished(code: Code, state: Value) -> Value:
    """The blocks with a pixel that can still take a Gaussian, as bits."""
    alive = code.variable(code.long(0))
    with code.loop(code.long(_BLOCKS)) as block:
        open_ = code.bits(code.load(state + block * _BLOCK_BYTES) > FINISHED).differs(0)
        alive.set(alive.get() | (code.select(open_, code.long(1), code.long(0)) << block))
    return alive.get()


def _each_block(code: Code, write) -> None:
    """``write(block, x_px, y_px)`` for each block of a tile."""
    with code.loop(code.long(_BLOCKS)) as block:
        write(block, (block & (BLOCKS_A_SIDE - 1)) << 2, (block >> 3) << 2)


def _row_address(code: Code, plane: Value, pitch: Value, x: Value, y: Value) -> list[Value]:
    """Where a block's four rows of four pixels stand in an image plane."""
    first = plane + (y * pitch + x) * 4
    return [first + pitch * (4 * row) for row in range(BLOCK_PX)]


@vector_kernel(void(int64, int64, int64))
def _store_plane(code: Code, source: Value, image: Value, pitch: Value) -> None:
    """A tile's plane to an image plane whose rows are ``pitch`` floats apart."""

    def write(block: Value, x: Value, y: Value) -> None:
        values = code.load(source + block * _BLOCK_BYTES)
        for row, address in enumerate(_row_address(code, image, pitch, x, y)):
            code.store_four(address, values, BLOCK_PX * row)

    _each_block(code, write)


@vector_kernel(void(int64, int64, int64))
def _load_plane(code: Code, target: Value, image: Value, pitch: Value) -> None:
    """The reverse of ``_store_plane``."""

    def write(block: Value, x: Value, y: Value) -> None:
        rows = [code.load_four(address) for address in _row_address(code, image, pitch, x, y)]
        code.store(target + block * _BLOCK_BYTES, code.joined(rows))

    _each_block(code, write)


@vector_kernel(void(int64, int64))
def _copy_coordinates(code: Code, state: Value, table: Value) -> None:
    """The pixel centres into the blocks' state."""
    with code.loop(code.long(_BLOCKS)) as block:
        for plane, start in ((_X, 0), (_Y, _COORDINATES_BYTES)):
            source = table + block * VECTOR_BYTES + (VECTOR_BYTES + start)
            code.store(state + block * _BLOCK_BYTES + plane * VECTOR_BYTES, code.load(source))


@vector_kernel(void(int64, int64, int64, float32))
def _multiply_add(code: Code, total: Value, a: Value, b: Value, factor: Value) -> None:
    """``total`` += ``factor`` times the product of two planes."""
    with code.loop(code.long(_BLOCKS)) as block:
        at = block * _BLOCK_BYTES
        product = code.load(a + at) * code.load(b + at)
        code.store(total + at, code.load(total + at) + product * factor)


@vector_kernel(void(int64, float32))
def _fill_plane(code: Code, plane: Value, value: Value) -> None:
    with code.loop(code.long(_BLOCKS)) as block:
        code.store(plane + block * _BLOCK_BYTES, code.spread(value))


@vector_kernel(void(int64, int64, int64))
def _clear_slots(code: Code, order: Value, count: Value, slots: Value) -> None:
    """No gradient for the entries behind a finished tile."""
    with code.loop(count) as i:
        entry = code.load_long(order + 8 * i) & 0xFFFFFFFF
        code.store(slots + entry * SLOT_BYTES, code.vector(0.0))


@kernel
def _blend_tile(state, start, stop, order, entries, records, middle_x, middle_y, table, with_depth):
    """Blend a tile's entries; returns the place in ``order`` after the last one needed."""
    batch = state + STATE_BYTES
    masks = batch + BATCH * RECORD_BYTES
    alive = -1
    while start < stop and alive != 0:
        count = min(BATCH, stop - start)
        _fetch(order + 8 * start, count, entries, records, middle_x, middle_y, batch, masks)
        if with_depth:
            _blend_with_depth(state, table, batch, masks, count, alive)
        else:
            _blend(state, table, batch, masks, count, alive)
        start += count
        alive = _unfinished(state)
    return start


@parallel_kernel
def composite(
    records, entries, order, tile_starts, tile_stops, tiles_x, planes, plane_floats, background, behind,
    scratch, table, with_depth,
):  # fmt: skip
    """Render all tiles into image planes of whole tiles: red, green, blue, transmittance, depth sum.

    All but ``tile_starts``, ``tile_stops`` (tiles,) int64 and ``background`` (3,) float32 are
    addresses or numbers. The planes are ``plane_floats`` apart and their rows whole tiles
    wide; ``behind``, unless 0, is the address of three such planes that stand in for
    ``background``; ``scratch`` holds SCRATCH_BYTES for each thread. ``tile_stops`` gets the
    place in ``order`` where a tile was finished.
    """
    tiles = tile_starts.shape[0] - 1
    pitch = tiles_x * TILE_PX
    for tile in prange(tiles):
        flags = flush_denormals()
        state = scratch + get_thread_id() * SCRATCH_BYTES
        x, y = tile % tiles_x * TILE_PX, tile // tiles_x * TILE_PX
        corner = 4 * (y * pitch + x)
        _copy_coordinates(state, table)
        _fill_plane(state, np.float32(1))
        for k in range(_SUMS, _SUMS + 4):
            _fill_plane(state + k * VECTOR_BYTES, np.float32(0))
        tile_stops[tile] = _blend_tile(
            state, tile_starts[tile], tile_starts[tile + 1], order, entries, records,
            x + TILE_PX // 2, y + TILE_PX // 2, table, with_depth,
        )  # fmt: skip
        spare = state + _SPARE * VECTOR_BYTES
        for k in range(3):
            colour = state + (_SUMS + k) * VECTOR_BYTES
            if behind != 0:
                _load_plane(spare, behind + 4 * k * plane_floats + corner, pitch)
            else:
                _fill_plane(spare, background[k])
            _multiply_add(colour, state, spare, np.float32(1))
            _store_plane(colour, planes + 4 * k * plane_floats + corner, pitch)
        _store_plane(state, planes + 4 * TRANSMITTANCE_PLANE * plane_floats + corner, pitch)
        if with_depth:
            depth = state + (_SUMS + 3) * VECTOR_BYTES
            _store_plane(depth, planes + 4 * DEPTH_PLANE * plane_floats + corner, pitch)
        restore_denormals(flags)


@kernel
def _load_upstream(state, planes, gradients, plane_bytes, corner, pitch, with_alpha, with_depth):
    """Fill the planes of gradients and of the rest, from the image and its gradient."""
    spare, rest = state + _SPARE * VECTOR_BYTES, state + _REST * VECTOR_BYTES
    _fill_plane(state, np.float32(1))
    _fill_plane(rest, np.float32(0))
    if with_alpha:
        upstream = state + _UPSTREAM * VECTOR_BYTES
        _load_plane(upstream, gradients + TRANSMITTANCE_PLANE * plane_bytes + corner, pitch)
        _load_plane(spare, planes + TRANSMITTANCE_PLANE * plane_bytes + corner, pitch)
        _multiply_add(rest, upstream, spare, np.float32(-1))
    for k in range(4 if with_depth else 3):
        plane = k if k < 3 else DEPTH_PLANE
        upstream = state + (_UPSTREAM + k) * VECTOR_BYTES
        _load_plane(upstream, gradients + plane * plane_bytes + corner, pitch)
        _load_plane(spare, planes + plane * plane_bytes + corner, pitch)
        _multiply_add(rest, upstream, spare, np.float32(1))


@parallel_kernel
def composite_backward(
    records, entries, order, tile_starts, tile_stops, tiles_x, planes, gradients, plane_floats, slots,
    scratch, table, with_alpha, with_depth,
):  # fmt: skip
    """Fill the slots of all entries from ``gradients``, planes in the layout of ``planes``.

    The plane of transmittance holds the gradient of alpha = 1 - transmittance. It, and that
    of depth, are read only when asked for.
    """
    tiles = tile_starts.shape[0] - 1
    pitch = tiles_x * TILE_PX
    for tile in prange(tiles):
        flags = flush_denormals()
        state = scratch + get_thread_id() * SCRATCH_BYTES
        batch = state + STATE_BYTES
        masks = batch + BATCH * RECORD_BYTES
        x, y = tile % tiles_x * TILE_PX, tile // tiles_x * TILE_PX
        corner = 4 * (y * pitch + x)
        _copy_coordinates(state, table)
        _load_upstream(state, planes, gradients, 4 * plane_floats, corner, pitch, with_alpha, with_depth)
        start, stop, alive = tile_starts[tile], tile_stops[tile], -1
        while start < stop:
            count = min(BATCH, stop - start)
            some = order + 8 * start
            _fetch(some, count, entries, records, x + TILE_PX // 2, y + TILE_PX // 2, batch, masks)
            if with_depth:
                _blend_backward_with_depth(state, table, batch, masks, count, alive, some, slots)
            else:
                _blend_backward(state, table, batch, masks, count, alive, some, slots)
            start += count
            alive = _unfinished(state)
        _clear_slots(order + 8 * stop, tile_starts[tile + 1] - stop, slots)
        restore_denormals(flags)

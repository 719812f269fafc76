"""Front-to-back compositing of a tile's Gaussians, and its gradient.

Each entry visits the blocks it touches. A pixel is finished when its transmittance
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
from functools import partial

import numpy as np
from numba import get_thread_id
from numba.core.types import int64, void

from .aligned_memory import aligned
from .batches import BATCH, BATCH_BYTES, FETCHED_BYTES, SLOT_BYTES, Fetched, ask_for, fetch
from .compiled import dealt, kernel, parallel_kernel, prange, turns
from .denormals import flush_denormals, restore_denormals
from .exponentials import EXP2_OF_EIGHTHS, exp2_of_eighths
from .lanes import lane_sums
from .projection import (
    EIGHTH_SMALLEST,
    LARGEST_ALPHA,
)
from .stages import in_stages
from .tiles import (
    BLOCK_BYTES,
    BLOCK_PX,
    DEPTH_PLANE,
    REST,
    RUN_OF_TILES,
    STATE_BYTES,
    SUMS,
    TILE_PX,
    UPSTREAM,
    ask_for_rows,
    open_blocks,
    open_gradient,
    open_tile,
    store_tile,
)
from .vectors import LANES, VECTOR_BYTES, Code, Value, Variable, vector_kernel

MOMENTS, BLENDED = 10, 10
"""In an entry's slot, its gradient sums: of g = alpha dL/dalpha the moments 1, e, f, e e, e f and x,
where x is the exponent's eighth (f f follows: x = eighth - e e - f f); the gradients of red, green,
blue and depth; then 1 if the entry was blended."""

FINISHED = 1e-4
"""A pixel whose transmittance is not above this takes no more Gaussians."""

_EIGHTH_LARGEST = math.log2(LARGEST_ALPHA) / 8.0

SCRATCH_BYTES = STATE_BYTES + BATCH_BYTES
"""What a thread needs: the tile's state and a batch of entries."""

_CONSTANTS = (*EXP2_OF_EIGHTHS, LARGEST_ALPHA, EIGHTH_SMALLEST, _EIGHTH_LARGEST, FINISHED)
_LARGEST, _EIGHTH_SMALLEST_AT, _EIGHTH_LARGEST_AT, _FINISHED_AT = range(6, 10)


def _table() -> np.ndarray:
    """(16,): the constants, in memory: the gradient's sums leave no registers for them."""
    table = aligned(LANES)
    table[: len(_CONSTANTS)] = _CONSTANTS
    return table


TABLE = _table()


def _constant(code: Code, table: Value, place: int) -> Value:
    return code.spread(code.load_float(table + 4 * place))


class _Splat(Fetched):
    """A fetched entry and its alpha at a block; ``constant`` gives those of the table."""

    def __init__(
        self, code: Code, state: Value, fetched: Value, depth: bool, constant: Callable[[int], Value]
    ) -> None:
        super().__init__(code, fetched, depth)
        self._state, self.constant = state, constant

    def visit(self, blocks: Value, blend: Callable[[bool, Value, list[Value]], None]) -> None:
        """``blend(held, place, [alpha, e, f, eighth])`` for each block, whose state is at ``place``."""
        # Most Gaussians need not be held.
        can_be_large = self.opacity_eighth >= self.code.float(_EIGHTH_LARGEST)
        for held, condition in ((True, can_be_large), (False, can_be_large.equals(False))):

            def blend_at(values: list[Value], held: bool = held) -> None:
                blend(held, values[0], values[1:])

            with self.code.when(condition):
                in_stages(blocks, self._exponent, partial(self._alpha, held), blend_at)

    def _exponent(self, block: Value) -> list[Value]:
        """Where the block's state is; e, f and the exponent's eighth."""
        return [self._state + block * BLOCK_BYTES, *self.exponent(block)]

    def _alpha(self, held: bool, at: list[Value]) -> list[Value]:
        """alpha, 0 where it is below 1/255, put before the others but the place.

        Only where ``held`` alpha can pass 0.99 and is held there.
        """
        code = self.code
        place, e, f, exponent = at
        alpha = exp2_of_eighths(exponent, [self.constant(k) for k in range(6)])
        if held:
            alpha = code.minimum(alpha, self.constant(_LARGEST))
        alpha = code.select(exponent >= self.constant(_EIGHTH_SMALLEST_AT), alpha, 0.0)
        return [place, alpha, e, f, exponent]

    def weight(self, alpha: Value, transmittance: Value) -> Value:
        """What a pixel takes of the splat: nothing if it is finished."""
        open_ = transmittance > self.constant(_FINISHED_AT)
        return self.code.select(open_, alpha * transmittance, 0.0)


def _write_blend(code: Code, depth: bool, *arguments: Value) -> None:
    state, table, batch, count, alive = arguments
    # Read once, into registers: from memory, each costs a quarter of a cycle for each visit.
    constants = [_constant(code, table, place) for place in range(len(_CONSTANTS))]
    with code.loop(count) as i:
        splat = _Splat(code, state, batch + i * FETCHED_BYTES, depth, constants.__getitem__)

        def blend(held: bool, place: Value, shape: list[Value], splat: _Splat = splat) -> None:
            transmittance = code.load(place)
            weight = splat.weight(shape[0], transmittance)
            code.store(place, transmittance - weight)
            for k, colour in enumerate(splat.colour):
                at = place + (SUMS + k) * VECTOR_BYTES
                code.store(at, code.fma(weight, colour, code.load(at)))

        splat.visit(splat.blocks & alive, blend)


def _write_blend_backward(code: Code, depth: bool, *arguments: Value) -> None:
    state, table, batch, count, alive, order, slots = arguments
    channels = 4 if depth else 3
    zero = code.vector(0.0)
    with code.loop(count) as i:
        splat = _Splat(code, state, batch + i * FETCHED_BYTES, depth, partial(_constant, code, table))
        sums = [code.variable(zero) for _ in range(6 + channels)]

        def blend(
            held: bool, place: Value, shape: list[Value], splat: _Splat = splat, sums: list[Variable] = sums
        ) -> None:
            alpha, e, f, exponent = shape
            transmittance = code.load(place)
            weight = splat.weight(alpha, transmittance)
            behind = transmittance - weight
            code.store(place, behind)
            upstream = [code.load(place + (UPSTREAM + k) * VECTOR_BYTES) for k in range(channels)]
            shade = upstream[0] * splat.colour[0]
            for g, colour in zip(upstream[1:], splat.colour[1:], strict=True):
                shade = code.fma(g, colour, shade)
            rest = code.fma(-weight, shade, code.load(place + REST * VECTOR_BYTES))
            code.store(place + REST * VECTOR_BYTES, rest)
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

        blocks = splat.blocks & alive
        slot = slots + (code.load_long(order + 8 * i) & 0xFFFFFFFF) * SLOT_BYTES
        code.store(slot, zero)
        with code.when(blocks.differs(0)):
            splat.visit(blocks, blend)
            code.store(slot, lane_sums([total.get() for total in sums]))
            if not depth:
                code.store_float(slot + 4 * (MOMENTS - 1), code.float(0.0))
            code.store_float(slot + 4 * BLENDED, code.float(1.0))


_BLEND = void(int64, int64, int64, int64, int64)
_BLEND_BACKWARD = void(int64, int64, int64, int64, int64, int64, int64)


@vector_kernel(_BLEND)
def _blend(code, state, table, batch, count, alive):
    """Put a batch of Gaussians behind what the blocks already have."""
    _write_blend(code, False, state, table, batch, count, alive)


@vector_kernel(_BLEND)
def _blend_with_depth(code, state, table, batch, count, alive):
    """The same, and the sum of weight * depth."""
    _write_blend(code, True, state, table, batch, count, alive)


@vector_kernel(_BLEND_BACKWARD)
def _blend_backward(code, state, table, batch, count, alive, order, slots):
    """Replay ``_blend`` and fill the entries' slots."""
    _write_blend_backward(code, False, state, table, batch, count, alive, order, slots)


@vector_kernel(_BLEND_BACKWARD)
def _blend_backward_with_depth(code, state, table, batch, count, alive, order, slots):
    """Replay ``_blend_with_depth`` and fill the entries' slots."""
    _write_blend_backward(code, True, state, table, batch, count, alive, order, slots)


@vector_kernel(int64(int64))
def _unfinished(code: Code, state: Value) -> Value:
    """The blocks with a pixel that can still take a Gaussian, as bits."""
    return open_blocks(code, state, FINISHED)


@vector_kernel(void(int64, int64, int64))
def _clear_slots(code: Code, order: Value, count: Value, slots: Value) -> None:
    """No gradient for the entries behind a finished tile."""
    with code.loop(count) as i:
        entry = code.load_long(order + 8 * i) & 0xFFFFFFFF
        code.store(slots + entry * SLOT_BYTES, code.vector(0.0))


@kernel
def _blend_tile(
    state, start, stop, order, entries, records, middle_x, middle_y, table, planes, plane_bytes, pitch,
    with_depth,
):  # fmt: skip
    """Blend a tile's entries; returns the place in ``order`` after the last one needed."""
    batch = state + STATE_BYTES
    alive, row = -1, 0
    while start < stop and alive != 0:
        count = min(BATCH, stop - start)
        if row < TILE_PX:
            ask_for_rows(planes, plane_bytes, pitch, DEPTH_PLANE + with_depth, row)
            row += BLOCK_PX
        fetch(order + 8 * start, count, entries, records, middle_x, middle_y, batch)
        if with_depth:
            _blend_with_depth(state, table, batch, count, alive)
        else:
            _blend(state, table, batch, count, alive)
        start += count
        alive = _unfinished(state)
    return start


@parallel_kernel
def composite(
    records, entries, order, tile_starts, tile_stops, tiles_x, planes, plane_bytes, background,
    background_plane_bytes, background_pitch, background_step, scratch, table, with_depth,
    threads,
):  # fmt: skip
    """Render all tiles into image planes of whole tiles: red, green, blue, transmittance, depth sum.

    All but ``tile_starts`` and ``tile_stops`` (tiles,) int64 are addresses or numbers. The
    planes are ``plane_bytes`` apart and their rows whole tiles wide; the background has its own
    strides (see ``store_tile``); ``scratch`` holds SCRATCH_BYTES for each thread. ``tile_stops``
    gets the place in ``order`` where a tile was finished.
    """
    tiles = tile_starts.shape[0] - 1
    pitch = 4 * tiles_x * TILE_PX
    each = turns(tiles, RUN_OF_TILES, threads)
    for number in prange(each * threads):
        tile = dealt(number, each, RUN_OF_TILES, threads)
        if tile >= tiles:
            continue
        flags = flush_denormals()
        state = scratch + get_thread_id() * SCRATCH_BYTES
        x, y = tile % tiles_x * TILE_PX, tile // tiles_x * TILE_PX
        target = planes + y * pitch + 4 * x
        open_tile(state)
        tile_stops[tile] = _blend_tile(
            state, tile_starts[tile], tile_starts[tile + 1], order, entries, records,
            x + TILE_PX // 2, y + TILE_PX // 2, table, target, plane_bytes, pitch, with_depth,
        )  # fmt: skip
        store_tile(
            state, target, plane_bytes, pitch,
            background + y * background_pitch + x // LANES * background_step,
            background_plane_bytes, background_pitch, background_step, with_depth,
        )  # fmt: skip
        restore_denormals(flags)


@parallel_kernel
def composite_backward(
    records, entries, order, tile_starts, tile_stops, tiles_x, planes, gradients, plane_bytes, slots,
    scratch, table, with_alpha, with_depth, threads,
):  # fmt: skip
    """Fill the slots of all entries from ``gradients``, planes in the layout of ``planes``.

    The plane of transmittance holds the gradient of alpha = 1 - transmittance. It, and that
    of depth, are read only when asked for.
    """
    tiles = tile_starts.shape[0] - 1
    pitch = 4 * tiles_x * TILE_PX
    each = turns(tiles, RUN_OF_TILES, threads)
    for number in prange(each * threads):
        tile = dealt(number, each, RUN_OF_TILES, threads)
        if tile >= tiles:
            continue
        flags = flush_denormals()
        state = scratch + get_thread_id() * SCRATCH_BYTES
        batch = state + STATE_BYTES
        x, y = tile % tiles_x * TILE_PX, tile // tiles_x * TILE_PX
        corner = y * pitch + 4 * x
        open_gradient(
            state, planes + corner, gradients + corner, plane_bytes, pitch,
            with_alpha, with_depth,
        )  # fmt: skip
        start, stop, alive = tile_starts[tile], tile_stops[tile], -1
        while start < stop:
            count = min(BATCH, stop - start)
            some = order + 8 * start
            fetch(some, count, entries, records, x + TILE_PX // 2, y + TILE_PX // 2, batch)
            if start == tile_starts[tile]:
                ask_for(some, count, entries, records, slots)
            ask_for(some + 8 * count, min(BATCH, stop - start - count), entries, records, slots)
            if with_depth:
                _blend_backward_with_depth(state, table, batch, count, alive, some, slots)
            else:
                _blend_backward(state, table, batch, count, alive, some, slots)
            start += count
            alive = _unfinished(state)
        _clear_slots(order + 8 * stop, tile_starts[tile + 1] - stop, slots)
        restore_denormals(flags)

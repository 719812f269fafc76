"""Front-to-back compositing of a tile's Gaussians, and its gradient.

Each entry visits the blocks it touches. A pixel is finished when its transmittance
falls to ``FINISHED`` or below and a block when all its pixels are; the tile ends with
its last block. The gradient visits the entries in the same order again. What a visit does
stands in ``blending`` and ``blending_gradient``.
"""

from __future__ import annotations

from numba import get_thread_id
from numba.core.types import int64, void

from ..vector_language.denormals import flush_denormals, restore_denormals
from ..vector_language.registers import REGISTER_LANES
from ..vector_language.vectors import LANES, Code, Value, vector_kernel
from .batches import BATCH, BATCH_BYTES, SLOT_BYTES, ask_for_slots, entry_number, fetch
from .blending import FINISHED, write_blend
from .blending_gradient import GRADIENTS_BYTES, write_blend_gradient
from .compiled import dealt, kernel, parallel_kernel, prange, turns
from .tiles import (
    BLOCK_PX,
    DEPTH_PLANE,
    RUN_OF_TILES,
    STATE_BYTES,
    TILE_PX,
    ask_for_rows,
    open_blocks,
    open_gradient,
    open_tile,
    store_tile,
)

SCRATCH_BYTES = STATE_BYTES + BATCH_BYTES + GRADIENTS_BYTES
"""What a thread needs: the tile's state, a batch of entries, and the gradients of one."""

_BLEND = void(*[int64] * 9)
_BLEND_BACKWARD = void(*[int64] * 10)


@vector_kernel(_BLEND)
def _blend(code, state, table, batch, count, alive, order, left, entries, records):
    """Put a batch of Gaussians behind what the blocks already have."""
    write_blend(code, False, state, table, batch, count, alive, order, left, entries, records)


@vector_kernel(_BLEND)
def _blend_with_depth(code, state, table, batch, count, alive, order, left, entries, records):
    """The same, and the sum of weight * depth."""
    write_blend(code, True, state, table, batch, count, alive, order, left, entries, records)


@vector_kernel(_BLEND_BACKWARD)
def _blend_backward(code, state, table, batch, count, alive, order, left, entries, records, slots):
    """Replay ``_blend`` and fill the entries' slots."""
    write_blend_gradient(
        code, False, REGISTER_LANES, state, table, batch, count, alive, order, left, entries, records, slots
    )


@vector_kernel(_BLEND_BACKWARD)
def _blend_backward_with_depth(code, state, table, batch, count, alive, order, left, entries, records, slots):
    """Replay ``_blend_with_depth`` and fill the entries' slots."""
    write_blend_gradient(
        code, True, REGISTER_LANES, state, table, batch, count, alive, order, left, entries, records, slots
    )


@vector_kernel(int64(int64))
def _unfinished(code: Code, state: Value) -> Value:
    """The blocks with a pixel that can still take a Gaussian, as bits."""
    return open_blocks(code, state, FINISHED)


@vector_kernel(void(int64, int64, int64))
def _clear_slots(code: Code, order: Value, count: Value, slots: Value) -> None:
    """No gradient for the entries behind a finished tile."""
    with code.loop(count) as i:
        code.store(slots + entry_number(code, order, i) * SLOT_BYTES, code.vector(0.0))


@kernel
def _blend_tile(
    state, start, stop, order, entries, records, middle_x, middle_y, table, planes, plane_bytes, pitch, with_depth
):
    """Blend a tile's entries; returns the place in ``order`` after the last one needed."""
    batch = state + STATE_BYTES
    alive, row = -1, 0
    while start < stop and alive != 0:
        count = min(BATCH, stop - start)
        if row < TILE_PX:
            ask_for_rows(planes, plane_bytes, pitch, DEPTH_PLANE + with_depth, row)
            row += BLOCK_PX
        some, left = order + 8 * start, stop - start
        fetch(some, count, entries, records, middle_x, middle_y, batch)
        if with_depth:
            _blend_with_depth(state, table, batch, count, alive, some, left, entries, records)
        else:
            _blend(state, table, batch, count, alive, some, left, entries, records)
        start += count
        alive = _unfinished(state)
    return start


@parallel_kernel
def composite(
    records,
    entries,
    order,
    tile_starts,
    tile_stops,
    tiles_x,
    planes,
    plane_bytes,
    background,
    background_plane_bytes,
    background_pitch,
    background_step,
    scratch,
    table,
    with_depth,
    threads,
):
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
            state,
            tile_starts[tile],
            tile_starts[tile + 1],
            order,
            entries,
            records,
            x + TILE_PX // 2,
            y + TILE_PX // 2,
            table,
            target,
            plane_bytes,
            pitch,
            with_depth,
        )
        store_tile(
            state,
            target,
            plane_bytes,
            pitch,
            background + y * background_pitch + x // LANES * background_step,
            background_plane_bytes,
            background_pitch,
            background_step,
            with_depth,
        )
        restore_denormals(flags)


@parallel_kernel
def composite_backward(
    records,
    entries,
    order,
    tile_starts,
    tile_stops,
    tiles_x,
    planes,
    gradients,
    plane_bytes,
    slots,
    scratch,
    table,
    with_alpha,
    with_depth,
    threads,
):
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
        open_gradient(state, planes + corner, gradients + corner, plane_bytes, pitch, with_alpha, with_depth)
        start, stop, alive = tile_starts[tile], tile_stops[tile], -1
        while start < stop:
            count = min(BATCH, stop - start)
            some, left = order + 8 * start, stop - start
            fetch(some, count, entries, records, x + TILE_PX // 2, y + TILE_PX // 2, batch)
            if start == tile_starts[tile]:
                ask_for_slots(some, count, slots)
            if with_depth:
                _blend_backward_with_depth(state, table, batch, count, alive, some, left, entries, records, slots)
            else:
                _blend_backward(state, table, batch, count, alive, some, left, entries, records, slots)
            start += count
            alive = _unfinished(state)
        _clear_slots(order + 8 * stop, tile_starts[tile + 1] - stop, slots)
        restore_denormals(flags)

"""Which Gaussians touch which blocks of which tiles, in the order of their depth.

An *entry* is a Gaussian in a tile: its number and the blocks that its ellipse (alpha above
1/255) touches as 64 bits. The intersection is exact, row of blocks by row of blocks:
sixteen rows are one vector.
"""

from __future__ import annotations

import numpy as np
from numba.core.types import int64

from ..vector_language.denormals import flush_denormals, restore_denormals
from ..vector_language.vectors import LANES, Code, Value, vector_kernel
from .compiled import dealt, kernel, parallel_kernel, prange, turns
from .projection import (
    BLOCK,
    DEPTH,
    EIGHTH,
    EIGHTH_SMALLEST,
    EXTENT_Y,
    FACTOR_B,
    FACTOR_C,
    INVERSE_A,
    RECORD_BYTES,
    SKEW_Y,
    TILES_X,
    TILES_Y,
    U,
    V,
)
from .tiles import BLOCK_PX, RUN_OF_TILES, TILE_SHIFT

SEGMENTS = 16
"""The Gaussians are binned in this many runs, each by one thread at a time."""

ENTRY_BYTES = 16
"""An entry: its blocks (int64), its Gaussian (int32), its tile (int32)."""

_SLACK_PX = 0.05
"""Blocks this near to an ellipse count as touched, so that rounding loses no pixel."""

_SMALLEST_SQUARE = 1e-12
"""Below it the ellipse's row is a point; the slack is wider. A root by an estimate needs it."""

_DIGIT_BITS = 9
_DIGITS = 1 << _DIGIT_BITS
_SHORT_LIST = 1024  # moving one entry after the other takes no longer than this allows


@vector_kernel(int64(int64, int64, int64, int64, int64, int64, int64))
def _append_entries(
    code: Code,
    record: Value,
    gaussian: Value,
    entries: Value,
    count: Value,
    capacity: Value,
    width: Value,
    height: Value,
) -> Value:
    """Append a Gaussian's entries; returns how many there are then.

    At most ``capacity`` are written, the last one over and over; the count goes on.
    """

    def field(place: int) -> Value:
        return code.load_float(record + 4 * place)

    def tiles(place: int) -> tuple[Value, Value]:
        """The first and the last."""
        both = code.load_int(record + 4 * place)
        return both & 0xFFFF, both >> 16

    u, v, b, c = field(U), field(V), field(FACTOR_B), field(FACTOR_C)
    inverse_a, extent_y, skew = field(INVERSE_A), field(EXTENT_Y), field(SKEW_Y)
    level = field(EIGHTH) - EIGHTH_SMALLEST
    last_x = (width - 1) >> TILE_SHIFT
    columns = code.to_floats((width - 1) >> 2)
    (first_tile_x, last_tile_x), (first_tile_y, last_tile_y) = tiles(TILES_X), tiles(TILES_Y)
    lane_top = code.vector([BLOCK_PX * k + 0.5 for k in range(LANES)])
    number = code.variable(count)
    tile_y = code.variable(first_tile_y)
    with code.loop_while(lambda: tile_y.get() <= last_tile_y):
        # The ellipse within each row of blocks: dy between top and bottom, dx between left and right.
        first_row_px = code.to_floats(tile_y.get() << TILE_SHIFT)
        from_top = lane_top + first_row_px
        top = code.maximum(from_top - (v + _SLACK_PX), -extent_y)
        bottom = code.minimum(from_top - (v - (BLOCK_PX - 1.0) - _SLACK_PX), extent_y)
        touched = (top <= bottom) & (from_top < code.to_floats(height))

        def reach(dy: Value, top: Value = top, bottom: Value = bottom) -> tuple[Value, Value]:
            """Half the width, and the middle, of the ellipse at ``dy`` held in the row."""
            held = code.minimum(code.maximum(dy, top), bottom)
            f = held * c
            square = code.maximum(level - f * f, _SMALLEST_SQUARE)
            half = square * code.quotient(inverse_a, code.sqrt(square))
            return half, held * (b * inverse_a)

        (half_right, middle_right), (half_left, middle_left) = (
            reach(code.vector(0.0) + skew),
            reach(code.vector(0.0) - skew),
        )
        right = (half_right - middle_right + (u - 0.5 + _SLACK_PX)) * (1.0 / BLOCK_PX)
        left = (u - (BLOCK_PX - 0.5) - _SLACK_PX - half_left - middle_left) * (1.0 / BLOCK_PX)
        # Rounded up and down; both are held so that rounding towards zero does it.
        first = code.to_integers(code.minimum(code.maximum(left, -1.0), columns) + 1.0)
        last = code.to_integers(code.maximum(code.minimum(right, columns) + 1.0, 0.0)) - 1

        def append(tile_x: Value, first: Value = first, last: Value = last, touched: Value = touched) -> None:
            """The entries of two tiles, one below the other; one that is not touched is written over."""
            offset = code.spread(code.to_int(tile_x << 3))
            low = first - offset
            high = last - offset
            low = code.select(low > 0, low, code.integers(0))
            high = code.select(high < 7, high, code.integers(7))
            present = touched & (low <= high)
            # Lanes without a block would shift by a number out of range.
            low, high = (code.select(present, x, code.integers(0)) for x in (low, high))
            bits = (code.integers(2) << high) - (code.integers(1) << low)
            upper, lower = code.bytes_of(code.select(present, bits, code.integers(0)))
            tile = tile_y.get() * (last_x + 1) + tile_x
            for blocks, place in ((upper, tile), (lower, tile + last_x + 1)):
                at = code.select(number.get() < capacity, number.get(), capacity - 1)
                address = entries + at * ENTRY_BYTES
                code.store_long(address, blocks)
                code.store_long(address + 8, gaussian | (place << 32))
                number.add(code.select(blocks.differs(0), code.long(1), code.long(0)))

        # Two at a time: most Gaussians touch one or two, and which cannot be foreseen.
        tile_x = code.variable(first_tile_x)
        with code.loop_while(lambda: tile_x.get() <= last_tile_x):
            append(tile_x.get())
            append(tile_x.get() + 1)
            tile_x.add(code.long(2))
        tile_y.add(code.long(2))
    return number.get()


@parallel_kernel
def append_entries(records, visible, width, height, entries, capacity, starts, counts, totals):
    """The entries of all visible Gaussians, in segments of ``capacity`` from the address ``entries``.

    ``starts`` and ``counts`` (16 chunks,) int32 get each visible Gaussian's first entry and
    their number; ``totals`` (SEGMENTS,) int64 the entries a segment needs, which may be
    more than it can hold.
    """
    blocks = (visible.shape[0] + BLOCK - 1) // BLOCK
    for segment in prange(SEGMENTS):
        state = flush_denormals()
        base = entries + segment * capacity * ENTRY_BYTES
        total = 0
        for chunk in range(
            blocks * segment // SEGMENTS * BLOCK, min(visible.shape[0], blocks * (segment + 1) // SEGMENTS * BLOCK)
        ):
            bits = visible[chunk]
            lane = 0
            while bits:
                if bits & 1:
                    i = chunk * LANES + lane
                    after = _append_entries(records + i * RECORD_BYTES, i, base, total, capacity, width, height)
                    starts[i] = segment * capacity + total
                    counts[i] = after - total
                    total = after
                bits >>= 1
                lane += 1
        totals[segment] = total
        restore_denormals(state)


@parallel_kernel
def _count_tiles(entries, capacity, totals, histogram):
    """``histogram`` (SEGMENTS, tiles) int32: the entries of each segment in each tile."""
    for segment in prange(SEGMENTS):
        histogram[segment, :] = 0
        for entry in range(segment * capacity, segment * capacity + totals[segment]):
            histogram[segment, entries[entry, 3]] += 1


@kernel
def _place_tiles(histogram, tile_starts):
    """``histogram`` becomes each segment's first place in each tile, ``tile_starts`` the tiles'."""
    place = 0
    for tile in range(histogram.shape[1]):
        tile_starts[tile] = place
        for segment in range(SEGMENTS):
            size = histogram[segment, tile]
            histogram[segment, tile] = place
            place += size
    tile_starts[histogram.shape[1]] = place


@parallel_kernel
def _scatter_entries(entries, capacity, totals, record_bits, histogram, order):
    """``order`` (E,) uint64, tile by tile: the depth's bits above the entry's number."""
    for segment in prange(SEGMENTS):
        for entry in range(segment * capacity, segment * capacity + totals[segment]):
            tile = entries[entry, 3]
            place = histogram[segment, tile]
            histogram[segment, tile] = place + 1
            depth = record_bits[entries[entry, 2], DEPTH]
            order[place] = (np.uint64(depth) << np.uint64(32)) | np.uint64(entry)


@kernel
def _sort_tile(order, spare, digits):
    """Sort by depth (the order of equal ones is kept): radix sort on the bits that differ.

    In a short list only by the highest of them; the few that then stand wrong are moved.
    """
    count = order.shape[0]
    low = high = order[0] >> np.uint64(32)
    for i in range(count):
        depth = order[i] >> np.uint64(32)
        low = min(low, depth)
        high = max(high, depth)
    bits = 0
    while (high - low) >> np.uint64(bits):
        bits += 1
    shift = max(bits - 2 * _DIGIT_BITS, 0) if count <= _SHORT_LIST else 0
    source, target = order, spare
    passes = 0
    while shift < bits:
        digits[:] = 0
        for i in range(count):
            depth = (source[i] >> np.uint64(32)) - low
            digits[(depth >> np.uint64(shift)) & np.uint64(_DIGITS - 1)] += 1
        place = 0
        for digit in range(_DIGITS):
            size = digits[digit]
            digits[digit] = place
            place += size
        for i in range(count):
            depth = (source[i] >> np.uint64(32)) - low
            digit = (depth >> np.uint64(shift)) & np.uint64(_DIGITS - 1)
            target[digits[digit]] = source[i]
            digits[digit] += 1
        source, target = target, source
        shift += _DIGIT_BITS
        passes += 1
    if passes % 2 == 1:
        order[:] = source
    for i in range(1, count):
        moved, place = order[i], i
        while place > 0 and order[place - 1] > moved:
            order[place] = order[place - 1]
            place -= 1
        order[place] = moved


@parallel_kernel
def _sort_tiles(order, spare, tile_starts, threads):
    """Sort each tile's part of ``order`` by depth, then by the Gaussians' numbers."""
    tiles = tile_starts.shape[0] - 1
    each = turns(tiles, RUN_OF_TILES, threads)
    for number in prange(each * threads):
        tile = dealt(number, each, RUN_OF_TILES, threads)
        if tile >= tiles:
            continue
        start, stop = tile_starts[tile], tile_starts[tile + 1]
        if stop - start > 1:
            digits = np.empty(_DIGITS, np.int32)
            _sort_tile(order[start:stop], spare[start:stop], digits)


@kernel
def sort_entries(entries, capacity, totals, record_bits, histogram, tile_starts, order, spare, threads):
    """Put what ``append_entries`` left into ``order``, tile by tile, the nearest first.

    ``order`` (E,) uint64 gets the depth's bits above the entry's number, ``tile_starts``
    (tiles + 1,) int64 where each tile begins there. ``entries`` (., 4) and ``record_bits``
    (., 16) are the memory's int32 and uint32; ``histogram`` (SEGMENTS, tiles) int32 and
    ``spare``, as ``order``, are written.
    """
    _count_tiles(entries, capacity, totals, histogram)
    _place_tiles(histogram, tile_starts)
    _scatter_entries(entries, capacity, totals, record_bits, histogram, order)
    _sort_tiles(order, spare, tile_starts, threads)

"""A tile's entries in batches: what blending reads of each, side by side in the nearest cache.

The entries are the tile's in the order of their depth, their Gaussians anywhere in memory. A
batch has for each the Gaussian's record with its blocks (see ``binning``) in place of U and V,
and its shares. At a pixel the exponent's eighth is EIGHTH - e e - f f, where

    e = FACTOR_A (x - U) + FACTOR_B (y - V),    f = FACTOR_C (y - V).

So e is a sum of what the pixel's place in its block adds, the block's column and its row, and
f of two of them: eight numbers for the columns of a tile and twice eight for the rows are all
that must be multiplied for an entry, beside the sixteen lanes of a block.
"""

from __future__ import annotations

from numba.core.types import int64, void

from ..vector_language.vectors import LANES, VECTOR_BYTES, Code, Value, vector_kernel
from .binning import ENTRY_BYTES
from .projection import DEPTH, EIGHTH, FACTOR_A, FACTOR_B, FACTOR_C, RECORD_BYTES, RED, U, V
from .tiles import BLOCK_PX, BLOCKS_A_SIDE, SIDE_SHIFT, TILE_PX

BATCH = 32
"""Entries that are fetched together."""

SLOT_BYTES = VECTOR_BYTES
"""What the gradient leaves for each entry: see ``compositing``."""

_BLOCKS = 0
_E_ACROSS, _E_DOWN, _F_DOWN = (RECORD_BYTES + k * VECTOR_BYTES // 2 for k in range(3))
FETCHED_BYTES = RECORD_BYTES + 2 * VECTOR_BYTES
"""Of an entry: the record, its blocks in place of U and V; the shares of e that columns add, and
rows; those of f that rows add."""

BATCH_BYTES = BATCH * FETCHED_BYTES

_LANE_X = [float(lane % BLOCK_PX) for lane in range(LANES)]
_LANE_Y = [float(lane // BLOCK_PX) for lane in range(LANES)]
_BLOCK_FROM_MIDDLE = [BLOCK_PX * (k % BLOCKS_A_SIDE) + 0.5 - TILE_PX / 2 for k in range(LANES)]
"""A lane's pixel in its block, and, twice, the first pixels of a tile's eight blocks from its middle."""


@vector_kernel(void(int64, int64, int64, int64, int64, int64, int64))
def fetch(
    code: Code,
    order: Value,
    count: Value,
    entries: Value,
    records: Value,
    middle_x: Value,
    middle_y: Value,
    batch: Value,
) -> None:
    """Fill a batch with the next ``count`` entries; the tile's middle is in pixels."""
    middle_x, middle_y = code.to_floats(middle_x), code.to_floats(middle_y)
    with code.loop(count) as i:
        number = entry_number(code, order, i)
        record = _record(code, entries, records, number)
        fetched = batch + i * FETCHED_BYTES
        code.store(fetched, code.load(record))
        code.store_long(fetched + _BLOCKS, code.load_long(entries + number * ENTRY_BYTES))
        a, b, c = (code.spread(code.load_float(record + 4 * k)) for k in (FACTOR_A, FACTOR_B, FACTOR_C))
        from_middle = code.vector(_BLOCK_FROM_MIDDLE)
        x = from_middle - (code.load_float(record + 4 * U) - middle_x)
        y = from_middle - (code.load_float(record + 4 * V) - middle_y)
        across_and_down = [*range(BLOCKS_A_SIDE), *range(LANES, LANES + BLOCKS_A_SIDE)]
        code.store(fetched + _E_ACROSS, code.shuffled(a * x, b * y, across_and_down))
        code.store(fetched + _F_DOWN, c * y)


@vector_kernel(void(int64, int64, int64))
def ask_for_slots(code: Code, order: Value, count: Value, slots: Value) -> None:
    """Have a tile's first slots in the cache when they are written; ``ask_ahead`` does so with the others."""
    with code.loop(count) as i:
        code.prefetch(slots + entry_number(code, order, i) * SLOT_BYTES, write=True)


def ask_ahead(
    code: Code, order: Value, i: Value, left: Value, entries: Value, records: Value, slots: Value | None = None
) -> None:
    """While entry ``i`` of a batch is blended, have what one of the next two needs in the cache.

    One entry at a time: the processor waits when it is asked for a whole batch at once. ``left``
    are the entries from the batch's first to the tile's last.
    """

    def entry_ahead(batches: int) -> Value:
        ahead = i + batches * BATCH
        return entry_number(code, order, code.select(ahead < left, ahead, i))

    code.prefetch(entries + entry_ahead(2) * ENTRY_BYTES)
    number = entry_ahead(1)
    code.prefetch(_record(code, entries, records, number))
    if slots is not None:
        code.prefetch(slots + number * SLOT_BYTES, write=True)


def entry_number(code: Code, order: Value, i: Value) -> Value:
    """Which entry comes at this place."""
    return code.load_long(order + 8 * i) & 0xFFFFFFFF


def _record(code: Code, entries: Value, records: Value, number: Value) -> Value:
    """Where an entry's Gaussian stands."""
    return records + code.load_int(entries + number * ENTRY_BYTES + 8) * RECORD_BYTES


class Fetched:
    """An entry of a batch, as blending reads it: ``colour`` with the depth if asked for.

    ``e_of_lane`` and ``f_of_lane`` are e and f but for what the block adds, ``eighth`` is the
    exponent's at the centre, in all lanes.
    """

    def __init__(self, code: Code, address: Value, depth: bool) -> None:
        def field(place: int) -> Value:
            return code.spread(code.load_float(address + 4 * place))

        self.code, self._address = code, address
        self.blocks = code.load_long(address + _BLOCKS)
        self.opacity_eighth = code.load_float(address + 4 * EIGHTH)
        self.colour = [field(RED + k) for k in range(3)] + ([field(DEPTH)] if depth else [])
        self.eighth = field(EIGHTH)
        x, y = code.vector(_LANE_X), code.vector(_LANE_Y)
        self.e_of_lane = code.fma(field(FACTOR_A), x, field(FACTOR_B) * y)
        self.f_of_lane = field(FACTOR_C) * y

    def exponent(self, block: Value) -> list[Value]:
        """e and f at a block's pixels, and the exponent's eighth."""
        code = self.code
        across, e_down, f_down = self._shares(block)
        e = code.added(code.added(self.e_of_lane, across), e_down)
        f = self.f_of_lane + f_down
        return [e, f, code.fma(-e, e, code.fma(-f, f, self.eighth))]

    def of_block(self, block: Value) -> list[Value]:
        """What is added to e and f of all lanes at a block, two scalars."""
        across, e_down, f_down = self._shares(block)
        return [across + e_down, f_down]

    def _shares(self, block: Value) -> list[Value]:
        """What a block's column adds to e, and its row to e and to f, scalars."""
        column = self._address + 4 * (block & (BLOCKS_A_SIDE - 1))
        row = self._address + 4 * (block >> SIDE_SHIFT)
        places = (column + _E_ACROSS, row + _E_DOWN, row + _F_DOWN)
        return [self.code.load_float(place) for place in places]

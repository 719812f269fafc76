"""Depth order of the projected Gaussians, and the lists of Gaussians of each tile.

A tile's list names only Gaussians whose ellipse (alpha >= 1/255) meets it, with the rows
they meet, front to back. Each entry has a place in an array of gradient slots in which
the entries of one Gaussian lie together, so gradients are added in a fixed order.
"""

from __future__ import annotations

import math

import numpy as np

from .compiled import inlined, kernel, parallel_kernel, prange
from .projection import DEPTH, EXTENT_X, EXTENT_Y, LOG2_OPACITY, QUAD_A, QUAD_B, QUAD_C, SMALLEST_ALPHA, U, V

TILE_WIDTH_PX = 8
TILE_HEIGHT_PX = 16

SEGMENTS = 16
"""The depth order is cut into this many runs, which are counted and scattered in parallel."""

_0, _4 = np.float32(0), np.float32(4)
_HALF = np.float32(0.5)
_SLACK_PX = np.float32(1e-3)
_LOG2_SMALLEST_ALPHA = np.float32(math.log2(SMALLEST_ALPHA))
_DIGITS = 256


@kernel
def sort_by_depth(visible, screen, order, spare, keys, spare_keys, ranks):
    """Fill ``order`` with the visible Gaussians, nearest first, and ``ranks`` with its inverse.

    A stable radix sort of the depths' bits: equal depths keep the order of their indices.
    All arrays have N elements; returns how many are visible.
    """
    count = 0
    for i in range(visible.shape[0]):
        ranks[i] = -1
        if visible[i]:
            order[count] = i
            keys[count] = np.float32(screen[i, DEPTH]).view(np.uint32)
            count += 1
    starts = np.empty(_DIGITS, np.int64)
    for digit in range(4):  # an even number of passes ends in ``order``
        shift = np.uint32(digit * 8)
        starts[:] = 0
        for i in range(count):
            starts[(keys[i] >> shift) & np.uint32(_DIGITS - 1)] += 1
        total = 0
        for bucket in range(_DIGITS):
            size = starts[bucket]
            starts[bucket] = total
            total += size
        for i in range(count):
            bucket = (keys[i] >> shift) & np.uint32(_DIGITS - 1)
            place = starts[bucket]
            starts[bucket] = place + 1
            spare_keys[place] = keys[i]
            spare[place] = order[i]
        keys, spare_keys = spare_keys, keys
        order, spare = spare, order
    for rank in range(count):
        ranks[order[rank]] = rank
    return count


@inlined
def _columns(row, tiles_x):
    """The first and last tile column that the ellipse's box meets."""
    first = int(max(row[U] - row[EXTENT_X], _0)) // TILE_WIDTH_PX
    last = int(max(min(row[U] + row[EXTENT_X], np.float32(tiles_x * TILE_WIDTH_PX)), _0)) // TILE_WIDTH_PX
    return first, min(last, tiles_x - 1)


@inlined
def _rows_in_column(row, column, height):
    """The first and last pixel row whose centres in a tile column lie in the ellipse."""
    quad_a, quad_b, quad_c = row[QUAD_A], row[QUAD_B], row[QUAD_C]
    reach = row[LOG2_OPACITY] - _LOG2_SMALLEST_ALPHA
    left = np.float32(column * TILE_WIDTH_PX) + _HALF - row[U]
    right = left + np.float32(TILE_WIDTH_PX - 1)
    first, last = 0, -1
    if left <= row[EXTENT_X] + _SLACK_PX and right >= -row[EXTENT_X] - _SLACK_PX:
        left = max(left, -row[EXTENT_X])
        right = min(right, row[EXTENT_X])
        inverse = _HALF / quad_c
        bend = quad_b * quad_b - _4 * quad_a * quad_c
        root_left = math.sqrt(max(bend * left * left + _4 * quad_c * reach, _0))
        root_right = math.sqrt(max(bend * right * right + _4 * quad_c * reach, _0))
        low = min((-quad_b * left - root_left) * inverse, (-quad_b * right - root_right) * inverse)
        high = max((-quad_b * left + root_left) * inverse, (-quad_b * right + root_right) * inverse)
        summit = -_HALF * quad_b * row[EXTENT_Y] / quad_a
        if left <= summit and summit <= right:
            high = row[EXTENT_Y]
        if left <= -summit and -summit <= right:
            low = -row[EXTENT_Y]
        low = max(row[V] + low - _HALF - _SLACK_PX, _0)
        high = min(row[V] + high - _HALF + _SLACK_PX, np.float32(height - 1))
        if high >= low:
            first, last = math.ceil(low), math.floor(high)
    return first, last


@parallel_kernel
def count_entries(order, count, screen, tiles_x, height, sorted_screen, counts, histogram):
    """Gather ``sorted_screen`` in depth order and count entries by Gaussian and by tile.

    ``counts`` (count,) int32 by rank; ``histogram`` (SEGMENTS, tiles) int32.
    """
    for segment in prange(SEGMENTS):
        histogram[segment] = 0
        for rank in range(count * segment // SEGMENTS, count * (segment + 1) // SEGMENTS):
            row = sorted_screen[rank]
            row[:] = screen[order[rank]]
            found = 0
            first_column, last_column = _columns(row, tiles_x)
            for column in range(first_column, last_column + 1):
                first, last = _rows_in_column(row, column, height)
                if last >= first:
                    for tile_y in range(first // TILE_HEIGHT_PX, last // TILE_HEIGHT_PX + 1):
                        histogram[segment, tile_y * tiles_x + column] += 1
                        found += 1
            counts[rank] = found


@kernel
def place_entries(counts, count, histogram, offsets, tile_starts):
    """Prefix sums: where each Gaussian's slots and each tile's entries start.

    ``histogram`` becomes each segment's next place in each tile; returns the entries' number.
    """
    total = 0
    for rank in range(count):
        offsets[rank] = total
        total += counts[rank]
    place = 0
    for tile in range(histogram.shape[1]):
        tile_starts[tile] = place
        for segment in range(SEGMENTS):
            size = histogram[segment, tile]
            histogram[segment, tile] = place
            place += size
    tile_starts[histogram.shape[1]] = place
    return total


@parallel_kernel
def scatter_entries(sorted_screen, count, tiles_x, height, offsets, histogram, entries):
    """Fill ``entries`` (E, 4) int32, tile by tile: rank, slot, first and last row in the tile."""
    for segment in prange(SEGMENTS):
        for rank in range(count * segment // SEGMENTS, count * (segment + 1) // SEGMENTS):
            row = sorted_screen[rank]
            slot = offsets[rank]
            first_column, last_column = _columns(row, tiles_x)
            for column in range(first_column, last_column + 1):
                first, last = _rows_in_column(row, column, height)
                if last >= first:
                    for tile_y in range(first // TILE_HEIGHT_PX, last // TILE_HEIGHT_PX + 1):
                        tile = tile_y * tiles_x + column
                        place = histogram[segment, tile]
                        histogram[segment, tile] = place + 1
                        top = tile_y * TILE_HEIGHT_PX
                        entries[place, 0] = rank
                        entries[place, 1] = slot
                        entries[place, 2] = max(first - top, 0)
                        entries[place, 3] = min(last - top, TILE_HEIGHT_PX - 1)
                        slot += 1

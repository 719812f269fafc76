"""Front-to-back compositing of a tile's Gaussians, and its gradient.

A tile's pixels lie in one flat scratch array, plane after plane, and the inner loops run
over whole rows of it without branches, so that the compiler vectorises them: indices are
unsigned and the planes' distances constant for that reason. A pixel is finished when its
transmittance falls below ``_FINISHED``; a tile, when all its pixels are.
"""

from __future__ import annotations

import math

import numpy as np

from .binning import TILE_HEIGHT_PX, TILE_WIDTH_PX
from .compiled import kernel, parallel_kernel, prange
from .projection import LARGEST_ALPHA, MOMENT_COLUMNS, PARTS, SCREEN_COLUMNS, SMALLEST_ALPHA

_PIXELS = TILE_WIDTH_PX * TILE_HEIGHT_PX
# The planes: transmittance, pixel centre, colour and depth; in the gradient's scratch also
# the gradients of colour and depth, and what is still to come of their product.
_X, _Y, _RED, _GREEN, _BLUE, _DEPTH = (np.uint64(k * _PIXELS) for k in range(1, 7))
_G_RED, _G_GREEN, _G_BLUE, _G_DEPTH, _REST = (np.uint64(k * _PIXELS) for k in range(3, 8))
_FORWARD_PLANES, _BACKWARD_PLANES = 7, 8

_BATCH = 16
"""Entries whose records are fetched together, so that the memory's latency overlaps; after
each batch a finished tile is noticed."""

_FINISHED = np.float32(1e-4)
_0, _1, _HALF = np.float32(0), np.float32(1), np.float32(0.5)
_LARGEST = np.float32(LARGEST_ALPHA)
_LOG2_LARGEST = np.float32(math.log2(LARGEST_ALPHA))
_LOG2_SMALLEST = np.float32(math.log2(SMALLEST_ALPHA))
_LOWEST_EXPONENT = np.float32(-20)  # far below 1/255, and no denormal can come of it

# Minimax fit of 2^x on [-1/2, 1/2], relative error 8e-8.
_E0, _E1, _E2, _E3, _E4, _E5 = (
    np.float32(c)
    for c in (1.00000007, 0.69314697, 0.24022120, 0.05550713, 0.00967554, 0.00132765)
)  # fmt: skip


@kernel
def _exp2(x):
    """2**x for -20 <= x <= 1 without a branch."""
    whole = np.int32(x - _HALF)
    part = x - np.float32(whole)
    mantissa = _E0 + part * (_E1 + part * (_E2 + part * (_E3 + part * (_E4 + part * _E5))))
    return np.int32((whole + np.int32(127)) << np.int32(23)).view(np.float32) * mantissa


@kernel
def _alpha(exponent, transmittance):
    """Alpha of a pixel: 0 below 1/255 and for a finished pixel, at most 0.99."""
    alpha = min(_exp2(max(exponent, _LOWEST_EXPONENT)), _LARGEST)
    return alpha if (exponent >= _LOG2_SMALLEST) & (transmittance > _FINISHED) else _0


@kernel
def _blend(s, first, last, u, v, qa, qb, qc, log2_opacity, red, green, blue, depth):
    """Put one Gaussian behind what the pixels first..last-1 already have."""
    for i in range(np.uint64(first), np.uint64(last)):
        dx = s[i + _X] - u
        dy = s[i + _Y] - v
        transmittance = s[i]
        weight = transmittance * _alpha(log2_opacity - dx * (qa * dx + qb * dy) - qc * dy * dy, transmittance)
        s[i] = transmittance - weight
        s[i + _RED] += weight * red
        s[i + _GREEN] += weight * green
        s[i + _BLUE] += weight * blue
        s[i + _DEPTH] += weight * depth


@kernel
def _blend_backward(s, first, last, u, v, qa, qb, qc, log2_opacity, red, green, blue, depth, moments):
    """Replay ``_blend`` and write the Gaussian's gradient sums over these pixels."""
    m, mx, my, mxx, mxy, myy = _0, _0, _0, _0, _0, _0
    g_red, g_green, g_blue, g_depth = _0, _0, _0, _0
    for i in range(np.uint64(first), np.uint64(last)):
        dx = s[i + _X] - u
        dy = s[i + _Y] - v
        transmittance = s[i]
        exponent = log2_opacity - dx * (qa * dx + qb * dy) - qc * dy * dy
        alpha = _alpha(exponent, transmittance)
        weight = transmittance * alpha
        shade = (
            red * s[i + _G_RED] + green * s[i + _G_GREEN] + blue * s[i + _G_BLUE] + depth * s[i + _G_DEPTH]
        )
        rest = s[i + _REST] - weight * shade
        s[i] = transmittance - weight
        s[i + _REST] = rest
        gradient = alpha * (transmittance * shade - rest / (_1 - alpha))
        gradient = gradient if exponent < _LOG2_LARGEST else _0
        g_red += weight * s[i + _G_RED]
        g_green += weight * s[i + _G_GREEN]
        g_blue += weight * s[i + _G_BLUE]
        g_depth += weight * s[i + _G_DEPTH]
        gx = gradient * dx
        gy = gradient * dy
        m += gradient
        mx += gx
        my += gy
        mxx += gx * dx
        mxy += gx * dy
        myy += gy * dy
    moments[0], moments[1], moments[2], moments[3], moments[4], moments[5] = m, mx, my, mxx, mxy, myy
    moments[6], moments[7], moments[8], moments[9] = g_red, g_green, g_blue, g_depth


@kernel
def _unfinished(s):
    """How many pixels can still take a Gaussian."""
    count = np.int32(0)
    for i in range(_PIXELS):
        count += np.int32(s[i] > _FINISHED)
    return count


@kernel
def _fetch(sorted_screen, entries, start, stop, left, top, batch):
    """Copy the entries' records into ``batch``, with centres relative to the tile."""
    for j in range(stop - start):
        rank = entries[start + j, 0]
        for k in range(SCREEN_COLUMNS):
            batch[j, k] = sorted_screen[rank, k]
        batch[j, 0] -= left
        batch[j, 1] -= top


@kernel
def _clear(s, planes):
    """Full transmittance, pixel centres relative to the tile, zero elsewhere."""
    s[_PIXELS * 3 : _PIXELS * planes] = _0
    for i in range(_PIXELS):
        s[i] = _1
        s[_PIXELS + i] = np.float32(i % TILE_WIDTH_PX) + _HALF
        s[2 * _PIXELS + i] = np.float32(i // TILE_WIDTH_PX) + _HALF


@parallel_kernel
def composite(
    sorted_screen, entries, tile_starts, tiles_x, background, colour, transmittance, depth, tile_stops
):
    """Fill ``colour`` (H, W, 3), ``transmittance`` (H, W) and ``depth`` (H, W), the sum of weight * depth.

    ``background`` is (H, W, 3), or (1, 1, 3) for one colour; ``tile_stops`` gets, for each
    tile, the entry at which it was finished.
    """
    height, width = transmittance.shape
    last_row, last_column = background.shape[0] - 1, background.shape[1] - 1
    tiles = tile_starts.shape[0] - 1
    for part in prange(PARTS):
        s = np.empty(_PIXELS * _FORWARD_PLANES, np.float32)
        batch = np.empty((_BATCH, SCREEN_COLUMNS), np.float32)
        for tile in range(part, tiles, PARTS):
            x0, y0 = tile % tiles_x * TILE_WIDTH_PX, tile // tiles_x * TILE_HEIGHT_PX
            _clear(s, _FORWARD_PLANES)
            start = tile_starts[tile]
            while start < tile_starts[tile + 1] and _unfinished(s) > 0:
                stop = min(start + _BATCH, tile_starts[tile + 1])
                _fetch(sorted_screen, entries, start, stop, np.float32(x0), np.float32(y0), batch)
                for j in range(stop - start):
                    b = batch[j]
                    _blend(
                        s, entries[start + j, 2] * TILE_WIDTH_PX, (entries[start + j, 3] + 1) * TILE_WIDTH_PX,
                        b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7], b[8], b[9],
                    )  # fmt: skip
                start = stop
            tile_stops[tile] = start
            for y in range(min(TILE_HEIGHT_PX, height - y0)):
                for x in range(min(TILE_WIDTH_PX, width - x0)):
                    i = y * TILE_WIDTH_PX + x
                    transmittance[y0 + y, x0 + x] = s[i]
                    depth[y0 + y, x0 + x] = s[i + 6 * _PIXELS]
                    behind = background[min(y0 + y, last_row), min(x0 + x, last_column)]
                    for k in range(3):
                        colour[y0 + y, x0 + x, k] = s[i + (3 + k) * _PIXELS] + s[i] * behind[k]


@parallel_kernel
def composite_backward(
    sorted_screen, entries, tile_starts, tile_stops, tiles_x, colour, transmittance, depth,
    g_colour, g_alpha, g_depth, slots,
):  # fmt: skip
    """Fill ``slots`` (E, 10) from the gradients of colour, alpha and the depth sum.

    With the transmittance T in front of it, a Gaussian's alpha has the gradient
    T * shade - rest / (1 - alpha), where rest is what the Gaussians behind it and the
    background add to the product of image and gradient: no second, backward pass is needed.
    """
    height, width = transmittance.shape
    tiles = tile_starts.shape[0] - 1
    for part in prange(PARTS):
        s = np.empty(_PIXELS * _BACKWARD_PLANES, np.float32)
        batch = np.empty((_BATCH, SCREEN_COLUMNS), np.float32)
        for tile in range(part, tiles, PARTS):
            x0, y0 = tile % tiles_x * TILE_WIDTH_PX, tile // tiles_x * TILE_HEIGHT_PX
            _clear(s, _BACKWARD_PLANES)
            for y in range(min(TILE_HEIGHT_PX, height - y0)):
                for x in range(min(TILE_WIDTH_PX, width - x0)):
                    i = y * TILE_WIDTH_PX + x
                    rest = g_depth[y0 + y, x0 + x] * depth[y0 + y, x0 + x]
                    rest -= g_alpha[y0 + y, x0 + x] * transmittance[y0 + y, x0 + x]
                    for k in range(3):
                        gradient = g_colour[y0 + y, x0 + x, k]
                        rest += gradient * colour[y0 + y, x0 + x, k]
                        s[i + (3 + k) * _PIXELS] = gradient
                    s[i + 6 * _PIXELS] = g_depth[y0 + y, x0 + x]
                    s[i + 7 * _PIXELS] = rest
            start = tile_starts[tile]
            while start < tile_stops[tile]:
                stop = min(start + _BATCH, tile_stops[tile])
                _fetch(sorted_screen, entries, start, stop, np.float32(x0), np.float32(y0), batch)
                for j in range(stop - start):
                    b = batch[j]
                    _blend_backward(
                        s, entries[start + j, 2] * TILE_WIDTH_PX, (entries[start + j, 3] + 1) * TILE_WIDTH_PX,
                        b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7], b[8], b[9],
                        slots[entries[start + j, 1]],
                    )  # fmt: skip
                start = stop
            for entry in range(tile_stops[tile], tile_starts[tile + 1]):
                for k in range(MOMENT_COLUMNS):
                    slots[entries[entry, 1], k] = _0

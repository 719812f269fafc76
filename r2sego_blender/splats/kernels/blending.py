"""How an entry of a batch is blended into the blocks that it touches.

Written once for the image and for its gradient (``blending_gradient``): which alpha a
Gaussian has at a block's pixels, and what a pixel takes of it. A pixel is finished when its
transmittance falls to ``FINISHED`` or below.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from ..vector_language.aligned_memory import aligned
from ..vector_language.exponentials import EXP2_OF_EIGHTHS, exp2_of_eighths
from ..vector_language.stages import in_stages
from ..vector_language.vectors import LANES, VECTOR_BYTES, Code, Value
from .batches import FETCHED_BYTES, Fetched, ask_ahead
from .projection import EIGHTH_SMALLEST, LARGEST_ALPHA
from .tiles import BLOCK_BYTES, SUMS

FINISHED = 1e-4
"""A pixel whose transmittance is not above this takes no more Gaussians."""

_EIGHTH_LARGEST = math.log2(LARGEST_ALPHA) / 8.0

_CONSTANTS = (*EXP2_OF_EIGHTHS, LARGEST_ALPHA, EIGHTH_SMALLEST, _EIGHTH_LARGEST, FINISHED)
_LARGEST, _EIGHTH_SMALLEST_AT, EIGHTH_LARGEST_AT, _FINISHED_AT = range(6, 10)


def _table() -> np.ndarray:
    """(16,): the constants, in memory: the gradient's sums leave no registers for them."""
    table = aligned(LANES)
    table[: len(_CONSTANTS)] = _CONSTANTS
    return table


TABLE = _table()


def constant(code: Code, table: Value, place: int) -> Value:
    """A number of the table, in all lanes."""
    return code.spread(code.load_float(table + 4 * place))


class Splat(Fetched):
    """A fetched entry and its alpha at a block; ``constant`` gives those of the table."""

    def __init__(self, code: Code, state: Value, fetched: Value, depth: bool, constant: Callable[[int], Value]) -> None:
        super().__init__(code, fetched, depth)
        self._state, self.constant = state, constant

    def visit(self, blocks: Value, blend: Callable[[bool, Value, list[Value]], None], with_small: bool = False) -> None:
        """``blend(held, place, [alpha, e, f, eighth])`` for each block, whose state is at ``place``.

        alpha is 0 where it is below 1/255. ``with_small`` leaves that to ``blend``, by ``is_taken``.
        """
        # Most Gaussians need not be held.
        can_be_large = self.opacity_eighth >= self.code.float(_EIGHTH_LARGEST)
        for held, condition in ((True, can_be_large), (False, can_be_large.equals(False))):

            def blend_at(values: list[Value], held: bool = held) -> None:
                blend(held, values[0], values[1:])

            with self.code.when(condition):
                in_stages(blocks, self._exponent, partial(self._alpha, held, with_small), blend_at)

    def _exponent(self, block: Value) -> list[Value]:
        """Where the block's state is; e, f and the exponent's eighth."""
        return [self._state + block * BLOCK_BYTES, *self.exponent(block)]

    def _alpha(self, held: bool, with_small: bool, at: list[Value]) -> list[Value]:
        """alpha, put before the others but the place.

        Only where ``held`` alpha can pass 0.99 and is held there.
        """
        code = self.code
        place, e, f, exponent = at
        alpha = exp2_of_eighths(exponent, [self.constant(k) for k in range(6)])
        if held:
            alpha = code.minimum(alpha, self.constant(_LARGEST))
        if not with_small:
            alpha = code.select(self._is_seen(exponent), alpha, 0.0)
        return [place, alpha, e, f, exponent]

    def is_open(self, transmittance: Value) -> Value:
        """Where a pixel is not finished."""
        return transmittance > self.constant(_FINISHED_AT)

    def is_taken(self, exponent: Value, transmittance: Value) -> Value:
        """Where a pixel takes something of the splat: alpha is 1/255 at least, and the pixel not finished."""
        return self._is_seen(exponent) & self.is_open(transmittance)

    def _is_seen(self, exponent: Value) -> Value:
        return exponent >= self.constant(_EIGHTH_SMALLEST_AT)


def write_blend(
    code: Code,
    depth: bool,
    state: Value,
    table: Value,
    batch: Value,
    count: Value,
    alive: Value,
    order: Value,
    left: Value,
    entries: Value,
    records: Value,
) -> None:
    """Put a batch's Gaussians behind what the blocks of ``alive`` already have.

    ``order`` and ``left`` are where the batch begins and what is left of its tile from there on.
    """
    # Read once, into registers: from memory, each costs a quarter of a cycle for each visit.
    constants = [constant(code, table, place) for place in range(len(_CONSTANTS))]
    with code.loop(count) as i:
        splat = Splat(code, state, batch + i * FETCHED_BYTES, depth, constants.__getitem__)
        ask_ahead(code, order, i, left, entries, records)

        def blend(held: bool, place: Value, shape: list[Value], splat: Splat = splat) -> None:
            transmittance = code.load(place)
            weight = code.select(splat.is_open(transmittance), shape[0] * transmittance, 0.0)
            code.store(place, transmittance - weight)
            for k, colour in enumerate(splat.colour):
                at = place + (SUMS + k) * VECTOR_BYTES
                code.store(at, code.fma(weight, colour, code.load(at)))

        splat.visit(splat.blocks & alive, blend)

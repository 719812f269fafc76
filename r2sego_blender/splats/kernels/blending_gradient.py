"""The gradient of blending: an entry's sums over its pixels.

The shade of a Gaussian is the product of its colour and the image's gradient, the rest that of
all that is seen where nothing is in front: the Gaussian itself, what is behind it, and the
background. Behind it the rest is another one, and

    rest = alpha shade + (1 - alpha) rest behind,    dL/dalpha = T (shade - rest behind)

with the transmittance T in front of it. So shade - rest behind = (shade - rest) / (1 - alpha),
and nothing need be stored for each pixel and Gaussian.

An entry has ten sums. Where there are registers for them beside all that a visit needs, each
visit adds to them. Elsewhere they would be written to memory and read again at each visit: there
visits leave their pixels' gradients in a buffer and add up the colours', in vectors as narrow as
a register, and a second loop over the blocks does nothing but add up the moments.
"""

from __future__ import annotations

from functools import partial

from ..vector_language.lanes import lane_sums
from ..vector_language.vectors import LANES, VECTOR_BYTES, Code, Value, Variable
from .batches import BATCH_BYTES, FETCHED_BYTES, SLOT_BYTES, ask_ahead, entry_number
from .blending import EIGHTH_LARGEST_AT, Splat, constant
from .tiles import BLOCKS, REST, UPSTREAM

MOMENTS, BLENDED = 10, 10
"""In an entry's slot, its gradient sums: of g = alpha dL/dalpha the moments 1, e, f, e e, e f and x,
where x is the exponent's eighth (f f follows: x = eighth - e e - f f); the gradients of red, green,
blue and depth; then 1 if the entry was blended."""

GRADIENTS_BYTES = BLOCKS * VECTOR_BYTES
"""Of the buffer for an entry's gradients, behind the batch."""


def write_blend_gradient(
    code: Code,
    depth: bool,
    sum_lanes: int,
    state: Value,
    table: Value,
    batch: Value,
    count: Value,
    alive: Value,
    order: Value,
    left: Value,
    entries: Value,
    records: Value,
    slots: Value,
) -> None:
    """Replay ``write_blend`` and fill the slots of a batch's entries.

    With sixteen ``sum_lanes`` a visit adds to all sums; with fewer, a second loop follows.
    """
    channels = 4 if depth else 3
    zero = code.vector(0.0)
    with code.loop(count) as i:
        splat = Splat(code, state, batch + i * FETCHED_BYTES, depth, partial(constant, code, table))
        ask_ahead(code, order, i, left, entries, records, slots)
        blocks = splat.blocks & alive
        slot = slots + entry_number(code, order, i) * SLOT_BYTES
        code.store(slot, zero)
        with code.when(blocks.differs(0)):
            if sum_lanes == LANES:
                sums = _sums_beside(code, splat, channels, blocks)
            else:
                sums = _sums_after(code, splat, channels, blocks, sum_lanes, batch + BATCH_BYTES)
            code.store(slot, lane_sums(sums))
            if not depth:
                code.store_float(slot + 4 * (MOMENTS - 1), code.float(0.0))
            code.store_float(slot + 4 * BLENDED, code.float(1.0))


def _pixel_gradients(
    code: Code, splat: Splat, channels: int, held: bool, place: Value, alpha: Value, exponent: Value
) -> tuple[Value, Value, list[Value]]:
    """A block's state is gone on with: its pixels' gradients, and weights beside the image's gradients."""
    transmittance = code.load(place)
    alpha = code.select(splat.is_taken(exponent, transmittance), alpha, 0.0)
    weight = alpha * transmittance
    code.store(place, transmittance - weight)
    upstream = [code.load(place + (UPSTREAM + k) * VECTOR_BYTES) for k in range(channels)]
    shade = upstream[0] * splat.colour[0]
    for g, colour in zip(upstream[1:], splat.colour[1:], strict=True):
        shade = code.fma(g, colour, shade)
    rest = code.load(place + REST * VECTOR_BYTES)
    above_rest = code.quotient(code.subtracted(shade, rest), code.subtracted(1.0, alpha))
    code.store(place + REST * VECTOR_BYTES, code.subtracted(shade, above_rest))
    gradient = weight * above_rest
    if held:
        gradient = code.select(exponent < splat.constant(EIGHTH_LARGEST_AT), gradient, 0.0)
    return gradient, weight, upstream


def _add_products(code: Code, sums: list[Variable], products: list[tuple[Value, Value]]) -> None:
    for total, (a, b) in zip(sums, products, strict=True):
        total.set(code.fma(a, b, total.get()))


def _sums_beside(code: Code, splat: Splat, channels: int, blocks: Value) -> list[Value]:
    """The sums, as they follow each other in a slot, by lanes: added to at each visit."""
    sums = [code.variable(code.vector(0.0)) for _ in range(6 + channels)]

    def blend(held: bool, place: Value, shape: list[Value]) -> None:
        alpha, e, f, exponent = shape
        gradient, weight, upstream = _pixel_gradients(code, splat, channels, held, place, alpha, exponent)
        along_e = gradient * e
        sums[0].add(gradient)
        sums[1].add(along_e)
        products = [(gradient, f), (along_e, e), (along_e, f), (gradient, exponent)]
        _add_products(code, sums[2:], products + [(weight, g) for g in upstream])

    splat.visit(blocks, blend, with_small=True)
    return [total.get() for total in sums]


def _sums_after(code: Code, splat: Splat, channels: int, blocks: Value, lanes: int, buffer: Value) -> list[Value]:
    """The same, in ``lanes`` of sixteen: the moments are summed after the visits."""
    nothing = code.cut(code.vector(0.0), lanes)[0]
    colours = [code.variable(nothing) for _ in range(channels)]
    place_of_next = code.variable(buffer)

    def blend(held: bool, place: Value, shape: list[Value]) -> None:
        alpha, _, _, exponent = shape
        gradient, weight, upstream = _pixel_gradients(code, splat, channels, held, place, alpha, exponent)
        code.store(place_of_next.get(), gradient)
        place_of_next.add(code.long(VECTOR_BYTES))
        cuts = [code.cut(g, lanes) for g in upstream]
        for k, part in enumerate(code.cut(weight, lanes)):
            _add_products(code, colours, [(part, g[k]) for g in cuts])

    splat.visit(blocks, blend, with_small=True)
    moments = [code.variable(nothing) for _ in range(6)]
    place_of_next.set(buffer)
    of_lane = [code.cut(x, lanes) for x in (splat.e_of_lane, splat.f_of_lane)]
    with code.loop_bits(blocks) as block:
        of_block = [code.cut(code.spread(x), lanes)[0] for x in splat.of_block(block)]
        gradients = code.cut(code.load(place_of_next.get()), lanes)
        place_of_next.add(code.long(VECTOR_BYTES))
        for gradient, *lane in zip(gradients, *of_lane, strict=True):
            e, f = (x + y for x, y in zip(lane, of_block, strict=True))
            along_e, along_f = gradient * e, gradient * f
            for total, value in zip(moments, (gradient, along_e, along_f), strict=False):
                total.add(value)
            _add_products(code, moments[3:], [(along_e, e), (along_e, f), (along_f, f)])
    *five, ff = (total.get() for total in moments)
    x = code.cut(splat.eighth, lanes)[0] * five[0] - five[3] - ff
    return [code.padded(total) for total in (*five, x, *(total.get() for total in colours))]

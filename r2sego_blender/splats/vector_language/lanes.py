"""What adds or exchanges the lanes of vectors: see ``vectors``."""

from __future__ import annotations

from collections.abc import Sequence

from .vectors import LANES, Value


def lane_sum(x: Value) -> Value:
    """The sum of the lanes, a scalar; the order of addition is fixed."""
    for distance in (8, 4, 2, 1):
        moved = [(k + distance) % LANES for k in range(LANES)]
        x = x + x.code.shuffled(x, x, moved)
    return x.lane(0)


def lane_sums(rows: Sequence[Value]) -> Value:
    """The sum over the lanes of each of one to sixteen vectors, in the lane of its number.

    Pairs of vectors become one, of which each has half of the lanes: four additions for each
    vector instead of sixteen.
    """
    shuffled, lanes = rows[0].code.shuffled, range(LANES)
    vectors, distances = list(rows), (8, 4, 2, 1)
    for distance in distances:
        pairs = zip(vectors[::2], [*vectors[1::2], vectors[-1]], strict=False)
        own = [k + LANES if k & distance else k for k in lanes]
        others = [(k ^ distance) + LANES if k & distance else k ^ distance for k in lanes]
        vectors = [shuffled(a, b, own) + shuffled(a, b, others) for a, b in pairs]
    (total,) = vectors
    # The first of the distances tells even from odd numbers, the last one low from high ones.
    order = [sum(d for j, d in enumerate(distances) if k >> j & 1) for k in lanes]
    return shuffled(total, total, order)


def quarters_exchanged(vectors: Sequence[Value]) -> list[Value]:
    """Four vectors whose quarters and numbers are exchanged; done twice, nothing changes."""
    a, b, c, d = vectors
    shuffled = a.code.shuffled
    low, high = list(range(LANES // 2)), list(range(LANES // 2, LANES))
    halves = [shuffled(x, y, half + [LANES + k for k in half]) for half in (low, high) for x, y in ((a, b), (c, d))]
    even = [k for k in range(2 * LANES) if k // 4 % 2 == 0]
    odd = [k for k in range(2 * LANES) if k // 4 % 2 == 1]
    return [shuffled(x, y, order) for x, y in (halves[:2], halves[2:]) for order in (even, odd)]


def every_fourth(vectors: Sequence[Value]) -> list[Value]:
    """Four vectors, 64 lanes in a row, dealt to four: number k has every fourth of them from the k-th on."""
    a, b, c, d = vectors
    even, odd = list(range(0, 2 * LANES, 2)), list(range(1, 2 * LANES, 2))
    shuffled = a.code.shuffled
    halves = [(shuffled(a, b, parity), shuffled(c, d, parity)) for parity in (even, odd)]
    return [shuffled(*halves[k & 1], (even, odd)[k >> 1]) for k in range(4)]


def side_by_side(vectors: Sequence[Value]) -> list[Value]:
    """The reverse of ``every_fourth``."""
    a, b, c, d = vectors
    shuffled = a.code.shuffled
    turns = [[k // 2 + (k & 1) * LANES + half for k in range(LANES)] for half in (0, LANES // 2)]
    halves = [[shuffled(x, y, order) for order in turns] for x, y in ((a, c), (b, d))]
    return [shuffled(halves[0][k >> 1], halves[1][k >> 1], turns[k & 1]) for k in range(4)]


def transposed(rows: Sequence[Value]) -> list[Value]:
    """Sixteen vectors whose lanes and numbers are exchanged."""
    rows = list(rows)
    shuffled = rows[0].code.shuffled
    for distance in (8, 4, 2, 1):
        low = [k if not k & distance else LANES + k - distance for k in range(LANES)]
        high = [k + distance if not k & distance else LANES + k for k in range(LANES)]
        swapped = list(rows)
        for k in range(LANES):
            if not k & distance:
                a, b = rows[k], rows[k + distance]
                swapped[k] = shuffled(a, b, low)
                swapped[k + distance] = shuffled(a, b, high)
        rows = swapped
    return rows

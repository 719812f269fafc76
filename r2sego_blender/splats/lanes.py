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

    Pairs of vectors are added into halves, then quarters: four additions for each
    vector instead of sixteen.
    """
    shuffled = rows[0].code.shuffled
    groups: list[tuple[Value, list[int]]] = [(row, [k]) for k, row in enumerate(rows)]
    size = LANES
    while size > 1:
        merged = []
        for first in range(0, len(groups), 2):
            a, owners_a = groups[first]
            b, owners_b = groups[first + 1] if first + 1 < len(groups) else (a, [-1] * len(owners_a))
            low = [g + k for g in range(0, LANES, size) for k in range(size // 2)]
            high = [k + size // 2 for k in low]
            lows = shuffled(a, b, low + [LANES + k for k in low])
            highs = shuffled(a, b, high + [LANES + k for k in high])
            merged.append((lows + highs, owners_a + owners_b))
        groups, size = merged, size // 2
    total, owners = groups[0]
    order = [owners.index(k) if k in owners else owners.index(0) for k in range(LANES)]
    return shuffled(total, total, order)


def quarters_exchanged(vectors: Sequence[Value]) -> list[Value]:
    """Four vectors whose quarters and numbers are exchanged; done twice, nothing changes."""
    a, b, c, d = vectors
    shuffled = a.code.shuffled
    low, high = list(range(LANES // 2)), list(range(LANES // 2, LANES))
    halves = [
        shuffled(x, y, half + [LANES + k for k in half]) for half in (low, high) for x, y in ((a, b), (c, d))
    ]
    even = [k for k in range(2 * LANES) if k // 4 % 2 == 0]
    odd = [k for k in range(2 * LANES) if k // 4 % 2 == 1]
    return [shuffled(x, y, order) for x, y in (halves[:2], halves[2:]) for order in (even, odd)]


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

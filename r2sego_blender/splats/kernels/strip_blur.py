"""SSIM's window over a strip of an image, row by row: across into a ring of rows, then down.

In a strip of 64 columns these are *dealt* to four vectors, every fourth to the same. So a
vector's neighbours are neighbours of all four, and are loaded once for them. A row's *line*
has five more vectors, with what lies before, between and after the four.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..metrics import SSIM_RADIUS_PX, ssim_window
from ..vector_language.lanes import every_fourth
from ..vector_language.vectors import LANES, VECTOR_BYTES, Code, Value

VECTORS = 4
COLUMNS = VECTORS * LANES
ROW_BYTES = VECTORS * VECTOR_BYTES
IMAGES = 4
"""The most that are blurred side by side."""

DELAY = SSIM_RADIUS_PX + 1
"""Rows from the one blurred across to the one blurred down: all below it are there."""

_WINDOW = [float(w) for w in ssim_window()]
_TAPS = len(_WINDOW)
_NEAR = LANES // VECTORS  # lanes that are taken over from each side; the window reaches two
_PLACE_BYTES = 2 * VECTOR_BYTES  # in a line, a vector and what lies between it and the last one
_LINE_BYTES = VECTORS * _PLACE_BYTES + VECTOR_BYTES
_LINES_BYTES = IMAGES * _LINE_BYTES
_RING_ROWS = 16  # a power of two above the window's eleven
_RING_BYTES = (_RING_ROWS + _TAPS - 1) * ROW_BYTES  # the first ten rows are repeated at the end
_RINGS = 2 * _LINES_BYTES

BLUR_BYTES = _RINGS + IMAGES * _RING_BYTES
"""What a thread needs: the lines of two rows, used in turn, and the rings."""


def dealt_row(left: Value, row: Sequence[Value], right: Value) -> tuple[list[Value], list[Value]]:
    """Four vectors of a row, and one on each side, as the vectors of a line and those between."""
    lanes = range(_NEAR)
    between = []
    for k in range(VECTORS + 1):
        after = [max(k - 1, 0) + VECTORS * lane for lane in lanes]
        before = [LANES + min(k, VECTORS - 1) + VECTORS * lane for lane in lanes]
        between.append(left.code.shuffled(right, left, _outermost(after, before)))
    return every_fourth(row), between


def between_dealt(left: Sequence[Value], right: Sequence[Value]) -> list[Value]:
    """What lies between a line's vectors, from those of the strips on its left and right."""
    order = _outermost(list(range(_NEAR)), list(range(2 * LANES - _NEAR, 2 * LANES)))
    pairs = zip([right[0], *right], [*left, left[-1]], strict=True)
    return [after.code.shuffled(after, before, order) for after, before in pairs]


def _outermost(first: list[int], last: list[int]) -> list[int]:
    """An order of lanes, in which those between do not matter."""
    return first + [0] * (LANES - len(first) - len(last)) + last


def store_line(code: Code, blur: Value, row: Value, image: int, own: Sequence[Value], between: Sequence[Value]) -> None:
    """Put a row of an image into its line."""
    line = _line(blur, row, image)
    for k, vector in enumerate(between):
        code.store(line + k * _PLACE_BYTES, vector)
    for k, vector in enumerate(own):
        code.store(line + (k * _PLACE_BYTES + VECTOR_BYTES), vector)


def blur_across(code: Code, blur: Value, row: Value, image: Value | int) -> None:
    """Blur an image's line of ``row`` into its ring."""
    line = _line(blur, row, image)
    neighbours = []
    for column in range(-SSIM_RADIUS_PX, VECTORS + SSIM_RADIUS_PX):
        lanes, vector = divmod(column, VECTORS)
        place = line + (vector * _PLACE_BYTES + VECTOR_BYTES + 4 * lanes)
        neighbours.append(code.load(place, aligned=lanes == 0))
    blurred = [_blurred(neighbours[k : k + _TAPS]) for k in range(VECTORS)]
    ring = blur + _RINGS + image * _RING_BYTES
    place = row & (_RING_ROWS - 1)
    again = code.select(place < _TAPS - 1, place + _RING_ROWS, place)
    for target in (ring + place * ROW_BYTES, ring + again * ROW_BYTES):
        for k, blurred_vector in enumerate(blurred):
            code.store(target + k * VECTOR_BYTES, blurred_vector)


def blurred_down(code: Code, blur: Value, images: int, row: Value, vector: Value | int) -> list[Value]:
    """The first ``images``, blurred, at one dealt vector of the row ``DELAY`` above ``row``."""
    top = (row - DELAY - SSIM_RADIUS_PX) & (_RING_ROWS - 1)
    first = blur + _RINGS + top * ROW_BYTES + vector * VECTOR_BYTES
    samples = [first + tap * ROW_BYTES for tap in range(_TAPS)]
    return [_blurred([code.load(at + k * _RING_BYTES) for at in samples]) for k in range(images)]


def _blurred(samples: Sequence[Value]) -> Value:
    """The window's sum of eleven samples.

    Those as far from its middle on either side have one weight and are added before: many
    processors add in other units than they multiply.
    """
    code, middle = samples[0].code, SSIM_RADIUS_PX
    total = samples[middle] * _WINDOW[middle]
    for weight, before, after in zip(_WINDOW[:middle], samples, reversed(samples), strict=False):
        total = code.fma(code.added(before, after), weight, total)
    return total


def _line(blur: Value, row: Value, image: Value | int) -> Value:
    return blur + (row & 1) * _LINES_BYTES + image * _LINE_BYTES

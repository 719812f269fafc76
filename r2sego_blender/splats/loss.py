"""The photometric loss of 3DGS, (1 - w) L1 + w (1 - SSIM), and its gradient in the image.

SSIM as in ``metrics``: 11x11 Gaussian window, zeros outside the image. A thread takes a
strip of one channel, 64 columns wide, from top to bottom: each row is blurred across into
a ring of sixteen rows, which then are blurred down, so that everything stays in the
nearest cache. Four blurred images are enough for the similarity (x, y, x x + y y, x y) and
three for its gradient.
"""

from __future__ import annotations

from collections.abc import Callable

import numba
import numpy as np
from numba import get_thread_id
from numba.core.types import float32, int64, void

from .compiled import parallel_kernel, prange
from .metrics import SSIM_C1, SSIM_C2, SSIM_RADIUS_PX, ssim_window
from .tiles import TILE_PX, planes_of
from .vectors import (
    LANES,
    VECTOR_BYTES,
    Code,
    Value,
    aligned,
    flush_denormals,
    restore_denormals,
    vector_kernel,
)

_CHANNELS = 3
_DERIVATIVES = 3
_VECTORS = 4
_COLUMNS = _VECTORS * LANES
_RING_ROWS = 16  # a power of two above the window's eleven
_LINE_BYTES = (_VECTORS + 2) * VECTOR_BYTES  # a row of the strip with a vector of margin on each side
_ROW_BYTES = _VECTORS * VECTOR_BYTES
_WINDOW = [float(w) for w in ssim_window()]
_RADIUS = SSIM_RADIUS_PX
_TAPS = 2 * _RADIUS + 1

_IMAGES = 4
_RING_BYTES = (_RING_ROWS + _TAPS - 1) * _ROW_BYTES  # the first ten rows are repeated at the end
_SUM_BYTES = VECTOR_BYTES
_LINES_BYTES = _IMAGES * _LINE_BYTES
_LINES, _RINGS = _SUM_BYTES, _SUM_BYTES + 2 * _LINES_BYTES
_SCRATCH_BYTES = _RINGS + _IMAGES * _RING_BYTES


def _column_mask(code: Code, column: Value, width: Value) -> Value:
    """The lanes from ``column`` on that lie left of ``width``."""
    return code.integers(range(LANES)) < code.to_int(width - column)


def _blurred_across(code: Code, line: Value) -> list[Value]:
    """The window's weighted sums around all samples of a line, a vector after the other.

    Tap by tap for all vectors: neighbouring instructions then do not wait for each other.
    """
    vectors = [line + (k + 1) * VECTOR_BYTES for k in range(_VECTORS)]
    totals = [code.load(vector) * _WINDOW[_RADIUS] for vector in vectors]
    for tap in range(_TAPS):
        if tap != _RADIUS:
            for k, vector in enumerate(vectors):
                neighbour = code.load(vector + 4 * (tap - _RADIUS), aligned=False)
                totals[k] = code.fma(neighbour, _WINDOW[tap], totals[k])
    return totals


def _blurred_down(code: Code, first: Value, images: int) -> list[Value]:
    """The same down eleven rows of each image's ring."""
    totals = [code.load(first + image * _RING_BYTES) * _WINDOW[0] for image in range(images)]
    for tap in range(1, _TAPS):
        for image in range(images):
            sample = code.load(first + (image * _RING_BYTES + tap * _ROW_BYTES))
            totals[image] = code.fma(sample, _WINDOW[tap], totals[image])
    return totals


def _lines(scratch: Value, row: Value) -> Value:
    """Where the lines of a row stand: there are two sets, used in turn."""
    return scratch + _LINES + (row & 1) * _LINES_BYTES


def _blur_lines(code: Code, scratch: Value, images: int, row: Value) -> None:
    """Blur the lines of ``row`` across, into its place in their rings."""
    place = row & (_RING_ROWS - 1)
    again = code.select(place < _TAPS - 1, place + _RING_ROWS, place)
    targets = [scratch + _RINGS + p * _ROW_BYTES for p in (place, again)]
    lines = _lines(scratch, row)
    for image in range(images):
        for k, blurred in enumerate(_blurred_across(code, lines + image * _LINE_BYTES)):
            for target in targets:
                code.store(target + (image * _RING_BYTES + k * VECTOR_BYTES), blurred)


def _ring_rows(scratch: Value, row: Value) -> Value:
    """Where the eleven rows around ``row`` begin in the first ring."""
    return scratch + _RINGS + ((row - _RADIUS) & (_RING_ROWS - 1)) * _ROW_BYTES


def _load_line(
    code: Code, scratch: Value, sources: list[Value], start: Value, width: Value, inside: Value,
    put: Callable[[list[Value], int], None],
) -> None:  # fmt: skip
    """``put(values, vector)`` for the strip's vectors and margins, zeros outside the image.

    ``sources`` are the addresses of an image row's first sample; ``inside`` is 0 for a row
    above or below the image.
    """
    for k in range(_VECTORS + 2):
        column = start + (k - 1) * LANES
        known = _column_mask(code, column, width)
        readable = (column >= 0) & (column < width) & inside.differs(0)
        values = []
        for source in sources:
            # A vector that is not there is read from the scratch, and not used.
            address = code.select(readable, source + column * 4, scratch)
            kept = code.select(known, code.load(address), 0.0)
            values.append(code.select(code.spread(readable), kept, 0.0))
        put(values, k)


@vector_kernel(void(int64, int64, int64, int64, int64, int64, int64))
def _load_images(
    code: Code, scratch: Value, x: Value, y: Value, start: Value, width: Value, row: Value, inside: Value
) -> None:
    """Put a row of x, y, x x + y y and x y into its lines."""
    lines = _lines(scratch, row)

    def put(values: list[Value], k: int) -> None:
        a, b = values
        for image, value in enumerate((a, b, a * a + b * b, a * b)):
            code.store(lines + (image * _LINE_BYTES + k * VECTOR_BYTES), value)

    _load_line(code, scratch, [x, y], start, width, inside, put)


@vector_kernel(void(int64, int64, int64, int64, int64, int64, int64))
def _load_derivatives(
    code: Code, scratch: Value, derivatives: Value, plane_bytes: Value, start: Value, width: Value,
    row: Value, inside: Value,
) -> None:  # fmt: skip
    """Put a row of the three derivatives into its lines."""
    lines = _lines(scratch, row)

    def put(values: list[Value], k: int) -> None:
        for image, value in enumerate(values):
            code.store(lines + (image * _LINE_BYTES + k * VECTOR_BYTES), value)

    sources = [derivatives + plane_bytes * plane for plane in range(3)]
    _load_line(code, scratch, sources, start, width, inside, put)


@vector_kernel(void(int64, int64))
def _blur_four(code: Code, scratch: Value, row: Value) -> None:
    _blur_lines(code, scratch, 4, row)


@vector_kernel(void(int64, int64))
def _blur_three(code: Code, scratch: Value, row: Value) -> None:
    _blur_lines(code, scratch, 3, row)


@vector_kernel(void(int64, int64, int64, int64, int64, int64))
def _similarity_row(
    code: Code, scratch: Value, derivatives: Value, plane_bytes: Value, start: Value, width: Value, row: Value
) -> None:
    """SSIM of a row, added up, and its derivatives in the blurred x, x x and x y."""
    rows = _ring_rows(scratch, row)
    with code.loop(code.long(_VECTORS)) as k:
        offset = k * VECTOR_BYTES
        mean_x, mean_y, square, product = _blurred_down(code, rows + offset, 4)
        both = mean_x * mean_y
        squares = mean_x * mean_x + mean_y * mean_y
        luminance = 2.0 * both + SSIM_C1
        structure = 2.0 * (product - both) + SSIM_C2
        power = squares + SSIM_C1
        spread = square - squares + SSIM_C2
        inverse = code.quotient(1.0, power * spread)
        value = luminance * structure * inverse
        column = start + k * LANES
        by_mean = 2.0 * (mean_y * (structure - luminance) - mean_x * value * (spread - power)) * inverse
        by_square = -(value * inverse * power)
        by_product = 2.0 * luminance * inverse
        with code.when(column < width):  # beyond it the next row begins
            known = _column_mask(code, column, width)
            code.store(scratch, code.load(scratch) + code.select(known, value, 0.0))
            for plane, derivative in enumerate((by_mean, by_square, by_product)):
                code.store(derivatives + plane_bytes * plane + column * 4, derivative)


@vector_kernel(void(int64, int64, int64, int64, int64, int64, int64, int64, float32, float32))
def _gradient_row(
    code: Code, scratch: Value, x: Value, y: Value, weights: Value, gradient: Value, start: Value,
    width: Value, row: Value, by_difference: Value, by_similarity: Value,
) -> None:  # fmt: skip
    """The gradient of a row; its absolute differences are added up."""
    rows = _ring_rows(scratch, row)
    with code.loop(code.long(_VECTORS)) as k:
        offset = k * VECTOR_BYTES
        column = start + k * LANES
        by_mean, by_square, by_product = _blurred_down(code, rows + offset, 3)
        with code.when(column < width):
            known = _column_mask(code, column, width)
            a, b = code.load(x + column * 4), code.load(y + column * 4)
            difference = a - b
            sign = code.select(difference > 0.0, 1.0, code.select(difference < 0.0, -1.0, 0.0))
            code.store(scratch, code.load(scratch) + code.select(known, sign * difference, 0.0))
            total = sign * by_difference
            total = total + (by_mean + 2.0 * a * by_square + b * by_product) * by_similarity
            place = code.select(weights.differs(0), weights + column * 4, scratch)
            weight = code.select(code.spread(weights.differs(0)), code.load(place), 1.0)
            code.store(gradient + column * 4, code.select(known, total * weight, 0.0))


@vector_kernel(void(int64))
def _clear_sum(code: Code, scratch: Value) -> None:
    code.store(scratch, code.vector(0.0))


@vector_kernel(float32(int64))
def _read_sum(code: Code, scratch: Value) -> Value:
    return code.sum(code.load(scratch))


@parallel_kernel
def _similarity(x, y, derivatives, height, width, pitch, plane_floats, scratch, sums):
    """``sums`` (strips,) float64 and the three planes of derivatives, of one channel."""
    for strip in prange(sums.shape[0]):
        flags = flush_denormals()
        own = scratch + get_thread_id() * _SCRATCH_BYTES
        start = strip * _COLUMNS
        total = 0.0
        # A row is loaded one turn before it is blurred: what was just stored cannot be read
        # across the borders of its vectors without waiting.
        for row in range(-_RADIUS, height + _RADIUS + 1):
            inside = 1 if 0 <= row < height else 0
            at = 4 * pitch * row * inside
            _load_images(own, x + at, y + at, start, width, row, inside)
            if row > -_RADIUS:
                _blur_four(own, row - 1)
            if row > _RADIUS:
                _clear_sum(own)
                centre = row - 1 - _RADIUS
                target = derivatives + 4 * pitch * centre
                _similarity_row(own, target, 4 * plane_floats, start, width, centre)
                total += _read_sum(own)
        sums[strip] = total
        restore_denormals(flags)


@parallel_kernel
def _gradient(
    x, y, derivatives, weights, gradient, height, width, pitch, plane_floats, by_difference, by_similarity,
    scratch, sums,
):  # fmt: skip
    """``gradient`` of one channel, times ``weights`` (one plane, or address 0)."""
    for strip in prange(sums.shape[0]):
        flags = flush_denormals()
        own = scratch + get_thread_id() * _SCRATCH_BYTES
        start = strip * _COLUMNS
        total = 0.0
        for row in range(-_RADIUS, height + _RADIUS + 1):
            inside = 1 if 0 <= row < height else 0
            source = derivatives + 4 * pitch * row * inside
            _load_derivatives(own, source, 4 * plane_floats, start, width, row, inside)
            if row > -_RADIUS:
                _blur_three(own, row - 1)
            if row > _RADIUS:
                _clear_sum(own)
                centre = row - 1 - _RADIUS
                at = 4 * pitch * centre
                weight = weights + at if weights != 0 else 0
                _gradient_row(
                    own, x + at, y + at, weight, gradient + at, start, width, centre,
                    by_difference, by_similarity,
                )  # fmt: skip
                total += _read_sum(own)
        sums[strip] = total
        restore_denormals(flags)


class PhotometricLoss:
    """The loss of images of one size; its buffers are kept from call to call."""

    def __init__(self, height: int, width: int) -> None:
        self._shape = (height, width)
        size = (-(-height // TILE_PX) * TILE_PX, -(-width // TILE_PX) * TILE_PX)
        # One channel's derivatives: the next channel finds them in the cache.
        self._derivatives = aligned((_DERIVATIVES, *size))
        self._pitch, self._plane_floats = size[1], size[0] * size[1]
        self._sums = np.zeros((2, _CHANNELS, -(-width // _COLUMNS)))
        self._scratch = aligned((numba.config.NUMBA_NUM_THREADS, _SCRATCH_BYTES), np.uint8)

    def __call__(
        self,
        image: np.ndarray,
        target: np.ndarray,
        ssim_weight: float,
        gradient: np.ndarray,
        weights: np.ndarray | None = None,
        scale: float = 1.0,
    ) -> float:
        """The loss; its gradient in the image, times ``scale`` and ``weights``, into ``gradient``.

        All are aligned planes of whole tiles as ``planes_of`` makes them: ``image``, ``target``
        and ``gradient`` (at least 3, H', W'), ``weights`` (1, H', W'). The loss itself is
        without weights. ``gradient`` is 0 outside the image if it was so before.
        """
        samples = _CHANNELS * self._shape[0] * self._shape[1]
        similarity, difference = self._sums
        shape = (*self._shape, self._pitch, self._plane_floats)
        data, scratch = self._derivatives.ctypes.data, self._scratch.ctypes.data
        by_difference = np.float32(scale * (1.0 - ssim_weight) / samples)
        by_similarity = np.float32(-scale * ssim_weight / samples)
        masks = 0 if weights is None else weights.ctypes.data
        for channel in range(_CHANNELS):
            x, y, g = (planes[channel].ctypes.data for planes in (image, target, gradient))
            _similarity(x, y, data, *shape, scratch, similarity[channel])
            _gradient(
                x, y, data, masks, g, *shape, by_difference, by_similarity, scratch, difference[channel]
            )
        loss = (1.0 - ssim_weight) * difference.sum() / samples
        return float(loss + ssim_weight * (1.0 - similarity.sum() / samples))


def photometric_loss(image: np.ndarray, target: np.ndarray, ssim_weight: float) -> tuple[float, np.ndarray]:
    """The loss of two images (H, W, 3) float32, and its gradient in the first, of its shape."""
    height, width = image.shape[:2]
    gradient = planes_of(np.zeros_like(image))
    loss = PhotometricLoss(height, width)(planes_of(image), planes_of(target), ssim_weight, gradient)
    return loss, np.ascontiguousarray(np.moveaxis(gradient[:, :height, :width], 0, 2))

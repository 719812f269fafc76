"""The photometric loss of 3DGS, (1 - w) L1 + w (1 - SSIM), and its gradient in the image.

SSIM as in ``metrics``: 11x11 Gaussian window, zeros outside the image. A thread takes strips
of one channel, 64 columns wide, from the left, each from top to bottom: a row is blurred
across into a ring of sixteen rows, which are blurred down, so that this stays in the nearest
cache. Four blurred images are enough for the similarity (x, y, x x + y y, x y) and three,
its derivatives, for the gradient. The gradient of a strip follows when the derivatives of the
next are there: those of three strips are kept, and stay in the second cache.
"""

from __future__ import annotations

import itertools

import numba
import numpy as np
from numba import get_thread_id
from numba.core.types import float32, int64, void

from .aligned_memory import aligned
from .compiled import kernel, parallel_kernel, prange
from .denormals import flush_denormals, restore_denormals
from .lanes import lane_sum
from .metrics import SSIM_C1, SSIM_C2, SSIM_RADIUS_PX, ssim_window
from .tiles import planes_of
from .vectors import LANES, VECTOR_BYTES, Code, Value, vector_kernel

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
_DELAY = _RADIUS + 1  # rows from the one blurred across to the one blurred down: all below it are there

_IMAGES = 4
_RING_BYTES = (_RING_ROWS + _TAPS - 1) * _ROW_BYTES  # the first ten rows are repeated at the end
_SUM_BYTES = VECTOR_BYTES
_LINES_BYTES = _IMAGES * _LINE_BYTES
_STRIP_ROW_BYTES = _DERIVATIVES * _ROW_BYTES
_STRIPS_KEPT = 3
_STRIPS_A_TASK = 5
_SINK = _SUM_BYTES  # what lies outside the image is read here, and written
_LINES = _SINK + VECTOR_BYTES
_RINGS = _LINES + 2 * _LINES_BYTES
_SCRATCH_BYTES = _RINGS + _IMAGES * _RING_BYTES


def _lines(scratch: Value, row: Value) -> Value:
    """Where the lines of a row stand: there are two sets, used in turn."""
    return scratch + _LINES + (row & 1) * _LINES_BYTES


def _blurred(code: Code, scratch: Value, images: int, row: Value, vector: Value) -> list[Value]:
    """The blurred ``images`` at one vector of the row ``_DELAY`` above ``row``.

    Beside it the lines of ``row`` are blurred across into their rings. Across, the loads take
    longest, and down, the multiplications: tap by tap in turn neither waits for the other.
    """
    offset = vector * VECTOR_BYTES
    lines = _lines(scratch, row) + (offset + VECTOR_BYTES)
    ring = scratch + _RINGS + offset
    first = ring + ((row - _DELAY - _RADIUS) & (_RING_ROWS - 1)) * _ROW_BYTES
    across, down = [code.vector(0.0)] * images, [code.vector(0.0)] * images
    for tap, weight in enumerate(_WINDOW):
        for k in range(images):
            neighbour = code.load(lines + (k * _LINE_BYTES + 4 * (tap - _RADIUS)), aligned=tap == _RADIUS)
            across[k] = code.fma(neighbour, weight, across[k])
            sample = code.load(first + (k * _RING_BYTES + tap * _ROW_BYTES))
            down[k] = code.fma(sample, weight, down[k])
    place = row & (_RING_ROWS - 1)
    again = code.select(place < _TAPS - 1, place + _RING_ROWS, place)
    for target in (ring + place * _ROW_BYTES, ring + again * _ROW_BYTES):
        for k, blurred in enumerate(across):
            code.store(target + k * _RING_BYTES, blurred)
    return down


@vector_kernel(void(int64, int64, int64, int64, int64, int64, int64, int64))
def _load_images(
    code: Code, scratch: Value, x: Value, y: Value, pitch: Value, start: Value, width: Value, row: Value,
    inside: Value,
) -> None:  # fmt: skip
    """Put a row of x, y, x x + y y and x y into its lines, zeros outside the image.

    ``x`` and ``y`` are the addresses of an image row's first sample, ``pitch`` bytes above the
    next row's; ``inside`` is 0 for a row above or below the image.
    """
    lines = _lines(scratch, row)
    for k in range(_VECTORS + 2):
        column = start + (k - 1) * LANES
        there = (column >= 0) & (column < width) & inside.differs(0)
        a, b = (
            # A vector that is not there is read from the scratch, and not used.
            _kept(code, there, column, width, code.load(code.select(there, image + column * 4, scratch)))
            for image in (x, y)
        )
        for source in (x, y):
            # A strip's rows are too short for the processor to guess what comes next.
            code.prefetch(source + column * 4 + pitch)
        for image, value in enumerate((a, b, a * a + b * b, a * b)):
            code.store(lines + (image * _LINE_BYTES + k * VECTOR_BYTES), value)


@vector_kernel(void(int64, int64, int64, int64, int64, int64))
def _load_derivatives(
    code: Code, scratch: Value, left: Value, own: Value, right: Value, row: Value, inside: Value
) -> None:
    """Put a row of a strip's derivatives into its lines, with a vector of each of its neighbours'."""
    lines = _lines(scratch, row)
    inner = [own + k * VECTOR_BYTES for k in range(_VECTORS)]
    sources = [left + (_VECTORS - 1) * VECTOR_BYTES, *inner, right]
    for image, k in itertools.product(range(_DERIVATIVES), range(_VECTORS + 2)):
        value = code.load(sources[k] + image * _ROW_BYTES)
        value = code.select(code.spread(inside.differs(0)), value, 0.0)
        code.store(lines + (image * _LINE_BYTES + k * VECTOR_BYTES), value)


def _column_mask(code: Code, column: Value, width: Value) -> Value:
    """The lanes from ``column`` on that lie left of ``width``."""
    return code.integers(range(LANES)) < code.to_int(width - column)


def _kept(code: Code, there: Value, column: Value, width: Value, values: Value) -> Value:
    """The values inside the image, else 0."""
    return code.select(_column_mask(code, column, width) & code.spread(there), values, 0.0)


@vector_kernel(void(int64, int64, int64, int64, int64, int64, int64))
def _similarity_row(
    code: Code, scratch: Value, derivatives: Value, start: Value, width: Value, row: Value, first: Value,
    stop: Value,
) -> None:  # fmt: skip
    """Blur the lines of ``row``; add up SSIM in the row ``_DELAY`` above it, and store its derivatives.

    These are by the blurred x, x x and x y, in a strip's row; only vectors from ``first`` to
    before ``stop`` are computed.
    """
    with code.loop(stop, first) as k:
        mean_x, mean_y, square, product = _blurred(code, scratch, _IMAGES, row, k)
        both = mean_x * mean_y
        squares = mean_x * mean_x + mean_y * mean_y
        luminance = 2.0 * both + SSIM_C1
        structure = 2.0 * (product - both) + SSIM_C2
        power = squares + SSIM_C1
        spread = square - squares + SSIM_C2
        inverse = code.quotient(1.0, power * spread)
        value = luminance * structure * inverse
        by_mean = 2.0 * (mean_y * (structure - luminance) - mean_x * value * (spread - power)) * inverse
        by_square = -(value * inverse * power)
        by_product = 2.0 * luminance * inverse
        column = start + k * LANES
        there = row >= _DELAY  # no condition: without one, the blurs are computed side by side
        code.store(scratch, code.load(scratch) + _kept(code, there, column, width, value))
        for image, derivative in enumerate((by_mean, by_square, by_product)):
            place = derivatives + k * VECTOR_BYTES + image * _ROW_BYTES
            place = code.select(there, place, scratch + _SINK)
            code.store(place, _kept(code, there, column, width, derivative))


@vector_kernel(void(int64, int64, int64, int64, int64, int64, int64, int64, int64, float32, float32))
def _gradient_row(
    code: Code, scratch: Value, x: Value, y: Value, weights: Value, gradient: Value, pitch: Value,
    start: Value, width: Value, row: Value, by_difference: Value, by_similarity: Value,
) -> None:  # fmt: skip
    """Blur the lines of ``row``; the gradient of the row ``_DELAY`` above it.

    Its absolute differences are added up. ``x``, ``y``, ``weights`` and ``gradient`` are where
    that row stands, ``pitch`` bytes above the next.
    """
    with code.loop(code.long(_VECTORS)) as k:
        column = start + k * LANES
        by_mean, by_square, by_product = _blurred(code, scratch, _DERIVATIVES, row, k)
        there, sink = (row >= _DELAY) & (column < width), scratch + _SINK
        a, b = (code.load(code.select(there, image + column * 4, sink)) for image in (x, y))
        difference = a - b
        sign = code.select(difference > 0.0, 1.0, code.select(difference < 0.0, -1.0, 0.0))
        code.store(scratch, code.load(scratch) + _kept(code, there, column, width, sign * difference))
        total = sign * by_difference
        total = total + (by_mean + 2.0 * a * by_square + b * by_product) * by_similarity
        weighted = weights.differs(0)
        weight = code.load(code.select(there & weighted, weights + column * 4, sink))
        weight = code.select(code.spread(weighted), weight, 1.0)
        value = _kept(code, there, column, width, total * weight)
        code.store(code.select(there, gradient + column * 4, sink), value)
        code.prefetch(gradient + column * 4 + pitch, write=True)


@vector_kernel(void(int64))
def _clear_sum(code: Code, scratch: Value) -> None:
    code.store(scratch, code.vector(0.0))


@vector_kernel(float32(int64))
def _read_sum(code: Code, scratch: Value) -> Value:
    return lane_sum(code.load(scratch))


@vector_kernel(void(int64, int64))
def _clear(code: Code, address: Value, rows: Value) -> None:
    """No derivatives: the image does not reach so far."""
    with code.loop(rows * (_STRIP_ROW_BYTES // VECTOR_BYTES)) as k:
        code.store(address + k * VECTOR_BYTES, code.vector(0.0))


@kernel
def _similarity_strip(x, y, derivatives, start, height, width, pitch, first, stop, scratch):
    """Store a strip's derivatives; returns the sum of SSIM."""
    total = 0.0
    # A row is loaded one turn before it is blurred: what was just stored cannot be read
    # across the borders of its vectors without waiting.
    for row in range(-_RADIUS, height + _DELAY + 1):
        inside = 1 if 0 <= row < height else 0
        at = pitch * row * inside
        _load_images(scratch, x + at, y + at, pitch, start, width, row, inside)
        if row > -_RADIUS:
            _clear_sum(scratch)
            target = derivatives + _STRIP_ROW_BYTES * (row - 1 - _DELAY)
            _similarity_row(scratch, target, start, width, row - 1, first, stop)
            total += _read_sum(scratch)
    return total


@kernel
def _gradient_strip(
    x, y, left, own, right, weights, gradient, start, height, width, pitch, by_difference, by_similarity,
    scratch,
):  # fmt: skip
    """Store a strip's gradient; returns the sum of the absolute differences."""
    total = 0.0
    for row in range(-_RADIUS, height + _DELAY + 1):
        inside = 1 if 0 <= row < height else 0
        at = _STRIP_ROW_BYTES * row * inside
        _load_derivatives(scratch, left + at, own + at, right + at, row, inside)
        if row > -_RADIUS:
            _clear_sum(scratch)
            at = pitch * (row - 1 - _DELAY)
            weight = weights + at if weights != 0 else 0
            _gradient_row(
                scratch, x + at, y + at, weight, gradient + at, pitch, start, width, row - 1,
                by_difference, by_similarity,
            )  # fmt: skip
            total += _read_sum(scratch)
    return total


@parallel_kernel
def _loss_and_gradient(
    x, y, weights, gradient, height, width, pitch, plane_bytes, by_difference, by_similarity, scratch,
    scratch_bytes, similarity, difference,
):  # fmt: skip
    """``gradient`` times ``weights`` (one plane, or address 0); the sums of each strip.

    ``similarity`` and ``difference`` are (channels, strips) float64; ``scratch`` holds
    ``scratch_bytes`` for each thread.
    """
    channels, strips = similarity.shape
    tasks = (strips + _STRIPS_A_TASK - 1) // _STRIPS_A_TASK
    for task in prange(channels * tasks):
        flags = flush_denormals()
        own = scratch + get_thread_id() * scratch_bytes
        kept = own + _SCRATCH_BYTES
        kept_bytes = height * _STRIP_ROW_BYTES
        channel, first = task // tasks, task % tasks * _STRIPS_A_TASK
        stop = min(strips, first + _STRIPS_A_TASK)
        plane = channel * plane_bytes
        for strip in range(first - 1, stop + 1):
            derivatives = kept + (strip + 1) % _STRIPS_KEPT * kept_bytes
            if 0 <= strip < strips:
                # Of the strips beside the task's, only the vector at the border.
                begin = _VECTORS - 1 if strip < first else 0
                end = 1 if strip == stop else _VECTORS
                total = _similarity_strip(
                    x + plane, y + plane, derivatives, strip * _COLUMNS, height, width, pitch, begin, end, own
                )
                if first <= strip < stop:
                    similarity[channel, strip] = total
            else:
                _clear(derivatives, height)
            if strip > first:
                left, middle = (
                    kept + (strip - 1) % _STRIPS_KEPT * kept_bytes,
                    kept + strip % _STRIPS_KEPT * kept_bytes,
                )
                difference[channel, strip - 1] = _gradient_strip(
                    x + plane, y + plane, left, middle, derivatives, weights, gradient + plane,
                    (strip - 1) * _COLUMNS, height, width, pitch, by_difference, by_similarity, own,
                )  # fmt: skip
        restore_denormals(flags)


class PhotometricLoss:
    """The loss of images of one size; its buffers are kept from call to call."""

    def __init__(self, height: int, width: int) -> None:
        self._shape = (height, width)
        self._sums = np.zeros((2, _CHANNELS, -(-width // _COLUMNS)))
        scratch_bytes = _SCRATCH_BYTES + _STRIPS_KEPT * height * _STRIP_ROW_BYTES
        self._scratch = aligned((numba.config.NUMBA_NUM_THREADS, scratch_bytes), np.uint8)

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
        plane_bytes, pitch, _ = target.strides
        _loss_and_gradient(
            image.ctypes.data, target.ctypes.data, 0 if weights is None else weights.ctypes.data,
            gradient.ctypes.data, *self._shape, pitch, plane_bytes,
            np.float32(scale * (1.0 - ssim_weight) / samples), np.float32(-scale * ssim_weight / samples),
            self._scratch.ctypes.data, self._scratch.shape[1], similarity, difference,
        )  # fmt: skip
        loss = (1.0 - ssim_weight) * difference.sum() / samples
        return float(loss + ssim_weight * (1.0 - similarity.sum() / samples))


def photometric_loss(image: np.ndarray, target: np.ndarray, ssim_weight: float) -> tuple[float, np.ndarray]:
    """The loss of two images (H, W, 3) float32, and its gradient in the first, of its shape."""
    height, width = image.shape[:2]
    gradient = planes_of(np.zeros_like(image))
    loss = PhotometricLoss(height, width)(planes_of(image), planes_of(target), ssim_weight, gradient)
    return loss, np.ascontiguousarray(np.moveaxis(gradient[:, :height, :width], 0, 2))

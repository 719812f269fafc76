"""The photometric loss of 3DGS, (1 - w) L1 + w (1 - SSIM), and its gradient in the image.

SSIM as in ``metrics``: 11x11 Gaussian window, zeros outside the image. A thread takes bands
of rows of one channel, and in a band strips 64 columns wide, from the left, each from top to
bottom: a row is blurred across into a ring of rows, which are blurred down (``strip_blur``),
so that this stays in the nearest cache. Four blurred images are enough for the similarity
(x, y, x x + y y, x y) and three, its derivatives, for the gradient. The gradient of a strip
follows when the derivatives of the next are there: those of three strips are kept, and stay
in the second cache.
"""

from __future__ import annotations

import numba
import numpy as np
from numba import get_thread_id
from numba.core.types import float32, int64, void

from ..metrics import SSIM_C1, SSIM_C2, SSIM_RADIUS_PX
from ..vector_language.aligned_memory import aligned
from ..vector_language.denormals import flush_denormals, restore_denormals
from ..vector_language.lanes import lane_sum, side_by_side
from ..vector_language.vectors import LANES, VECTOR_BYTES, Code, Value, vector_kernel
from .compiled import kernel, parallel_kernel, prange
from .strip_blur import (
    BLUR_BYTES,
    COLUMNS,
    DELAY,
    IMAGES,
    ROW_BYTES,
    VECTORS,
    between_dealt,
    blur_across,
    blurred_down,
    dealt_row,
    store_line,
)

_CHANNELS = 3
_DERIVATIVES = 3
_STRIP_ROW_BYTES = _DERIVATIVES * ROW_BYTES
_STRIPS_KEPT = 3
_BAND_ROWS = 240
_BAND_BYTES = (_BAND_ROWS + 2 * SSIM_RADIUS_PX) * _STRIP_ROW_BYTES
_ROWS_AHEAD = 3  # a strip's rows are too short for the processor to guess what comes next

_SUM = BLUR_BYTES  # in a thread's scratch, after what is blurred
_SINK = _SUM + VECTOR_BYTES  # what lies outside the image is read here, and written
_NOTHING = _SINK + VECTOR_BYTES  # a strip's row outside the image: zeros
_KEPT = _NOTHING + _STRIP_ROW_BYTES
_SCRATCH_BYTES = _KEPT + _STRIPS_KEPT * _BAND_BYTES


def _lanes_before(code: Code, stop: Value, step: int = 1) -> Value:
    """The lanes, ``step`` columns from one to the next, before the column ``stop``."""
    return code.integers(range(0, step * LANES, step)) < code.to_int(stop)


def _masked(code: Code, there: Value, mask: Value, values: Value) -> Value:
    """The values of the mask's lanes, if they are there, else 0."""
    return code.select(mask & code.spread(there), values, 0.0)


def _add_up(code: Code, scratch: Value, values: Value) -> None:
    code.store(scratch + _SUM, code.load(scratch + _SUM) + values)


@vector_kernel(void(int64, int64, int64, int64, int64, int64, int64, int64))
def _load_images(
    code: Code, scratch: Value, x: Value, y: Value, pitch: Value, start: Value, width: Value, row: Value, inside: Value
) -> None:
    """Put a row of x, y, x x + y y and x y into its lines, zeros outside the image.

    ``x`` and ``y`` are the addresses of an image row's first sample, ``pitch`` bytes above the
    next row's; ``inside`` is 0 for a row above or below the image.
    """

    def loaded(image: Value, k: int) -> Value:
        column = start + k * LANES
        there = (column >= 0) & (column < width) & inside.differs(0)
        code.prefetch(image + column * 4 + pitch * _ROWS_AHEAD)
        # A vector that is not there is read from the sink, and not used.
        vector = code.load(code.select(there, image + column * 4, scratch + _SINK))
        return _masked(code, there, _lanes_before(code, width - column), vector)

    def dealt(image: Value) -> tuple[list[Value], list[Value]]:
        left, *inner, right = (loaded(image, k) for k in range(-1, VECTORS + 1))
        return dealt_row(left, inner, right)

    own, between = (
        [(a, b, code.fma(a, a, b * b), a * b) for a, b in zip(*vectors, strict=True)]
        for vectors in zip(dealt(x), dealt(y), strict=True)
    )
    for image in range(IMAGES):
        store_line(code, scratch, row, image, [v[image] for v in own], [v[image] for v in between])


@vector_kernel(void(int64, int64, int64, int64, int64))
def _load_derivatives(code: Code, scratch: Value, left: Value, own: Value, right: Value, row: Value) -> None:
    """Put a row of a strip's derivatives into its lines, with what lies beside it in its neighbours'."""
    for image in range(_DERIVATIVES):
        before, inner, after = (
            [code.load(strip + (image * ROW_BYTES + k * VECTOR_BYTES)) for k in range(VECTORS)]
            for strip in (left, own, right)
        )
        store_line(code, scratch, row, image, inner, between_dealt(before, after))


@vector_kernel(void(int64, int64, int64, int64, int64))
def _similarity_row(code: Code, scratch: Value, derivatives: Value, columns: Value, row: Value, there: Value) -> None:
    """Blur the lines of ``row``; add up SSIM in the row ``DELAY`` above it, and store its derivatives.

    These are by the blurred x, x x and x y, in a strip's row, dealt. ``columns`` of the strip
    are in the image; ``there`` is 0 if that row is not wanted.
    """
    there = there.differs(0)  # no condition: without one, the blurs are computed side by side
    with code.loop(code.long(VECTORS)) as k:
        blur_across(code, scratch, row, k)
        mean_x, mean_y, square, product = blurred_down(code, scratch, IMAGES, row, k)
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
        mask = _lanes_before(code, columns - k, VECTORS)
        _add_up(code, scratch, _masked(code, there, mask, value))
        for image, derivative in enumerate((by_mean, by_square, by_product)):
            place = derivatives + k * VECTOR_BYTES + image * ROW_BYTES
            place = code.select(there, place, scratch + _SINK)
            code.store(place, _masked(code, there, mask, derivative))


@vector_kernel(void(int64, int64, int64, int64, int64, int64, int64, int64, int64, float32, float32))
def _gradient_row(
    code: Code,
    scratch: Value,
    x: Value,
    y: Value,
    weights: Value,
    gradient: Value,
    pitch: Value,
    columns: Value,
    row: Value,
    there: Value,
    by_difference: Value,
    by_similarity: Value,
) -> None:
    """Blur the lines of ``row``; the gradient of the row ``DELAY`` above it.

    Its absolute differences are added up. ``x``, ``y``, ``weights`` and ``gradient`` are where
    that row of the strip stands, ``pitch`` bytes above the next; ``columns`` of it are in the
    image; ``there`` is 0 if that row is not wanted.
    """
    for image in range(_DERIVATIVES):
        blur_across(code, scratch, row, image)
    dealt = [blurred_down(code, scratch, _DERIVATIVES, row, k) for k in range(VECTORS)]
    by_derivatives = zip(*(side_by_side(vectors) for vectors in zip(*dealt, strict=True)), strict=True)
    sink = scratch + _SINK
    for k, (by_mean, by_square, by_product) in enumerate(by_derivatives):
        here = there.differs(0) & (columns > k * LANES)
        place = k * VECTOR_BYTES
        a, b = (code.load(code.select(here, image + place, sink)) for image in (x, y))
        mask = _lanes_before(code, columns - k * LANES)
        difference = a - b
        sign = code.select(difference > 0.0, 1.0, code.select(difference < 0.0, -1.0, 0.0))
        _add_up(code, scratch, _masked(code, here, mask, sign * difference))
        # In this order in all columns: an image that is moved has its gradient moved, to the bit.
        similarity = code.fma(b, by_product, code.fma(code.added(a, a), by_square, by_mean))
        total = code.fma(similarity, by_similarity, sign * by_difference)
        weighted = weights.differs(0)
        weight = code.load(code.select(here & weighted, weights + place, sink))
        weight = code.select(code.spread(weighted), weight, 1.0)
        value = _masked(code, here, mask, total * weight)
        code.store(code.select(here, gradient + place, sink), value)
        code.prefetch(gradient + place + pitch * _ROWS_AHEAD, write=True)


@vector_kernel(void(int64))
def _clear_sum(code: Code, scratch: Value) -> None:
    code.store(scratch + _SUM, code.vector(0.0))


@vector_kernel(float32(int64))
def _read_sum(code: Code, scratch: Value) -> Value:
    return lane_sum(code.load(scratch + _SUM))


@vector_kernel(void(int64, int64))
def _clear(code: Code, address: Value, count: Value) -> None:
    """No derivatives, in ``count`` vectors: the image does not reach so far."""
    with code.loop(count) as k:
        code.store(address + k * VECTOR_BYTES, code.vector(0.0))


@kernel
def _derivatives_of(scratch, strip):
    """Where those of a strip are kept, from a little above its band on."""
    return scratch + _KEPT + (strip + _STRIPS_KEPT) % _STRIPS_KEPT * _BAND_BYTES


@kernel
def _similarity_strip(x, y, derivatives, start, height, width, pitch, top, bottom, scratch):
    """Store the derivatives of a band's rows, and of those that its blur reaches; returns the sum of SSIM."""
    total = 0.0
    first, stop = max(top - SSIM_RADIUS_PX, 0), min(bottom + SSIM_RADIUS_PX, height)
    # A row is loaded one turn before it is blurred: what was just stored cannot be read
    # across the borders of its vectors without waiting.
    for row in range(first - SSIM_RADIUS_PX, stop + DELAY + 1):
        inside = 1 if 0 <= row < height else 0
        at = pitch * row * inside
        _load_images(scratch, x + at, y + at, pitch, start, width, row, inside)
        if row > first - SSIM_RADIUS_PX:
            _clear_sum(scratch)
            done = row - 1 - DELAY
            target = derivatives + _STRIP_ROW_BYTES * (done - first)
            _similarity_row(scratch, target, width - start, row - 1, 1 if done >= first else 0)
            if top <= done < bottom:
                total += _read_sum(scratch)
    return total


@kernel
def _gradient_strip(
    x,
    y,
    left,
    own,
    right,
    weights,
    gradient,
    start,
    height,
    width,
    pitch,
    top,
    bottom,
    by_difference,
    by_similarity,
    scratch,
):
    """Store the gradient of a strip in a band; returns the sum of the absolute differences."""
    total = 0.0
    first = max(top - SSIM_RADIUS_PX, 0)
    nothing = scratch + _NOTHING
    for row in range(top - SSIM_RADIUS_PX, bottom + DELAY + 1):
        at = _STRIP_ROW_BYTES * (row - first)
        if 0 <= row < min(bottom + SSIM_RADIUS_PX, height):
            _load_derivatives(scratch, left + at, own + at, right + at, row)
        else:
            _load_derivatives(scratch, nothing, nothing, nothing, row)
        if row > top - SSIM_RADIUS_PX:
            _clear_sum(scratch)
            done = row - 1 - DELAY
            at = pitch * done + 4 * start
            weight = weights + at if weights != 0 else 0
            _gradient_row(
                scratch,
                x + at,
                y + at,
                weight,
                gradient + at,
                pitch,
                width - start,
                row - 1,
                1 if done >= top else 0,
                by_difference,
                by_similarity,
            )
            total += _read_sum(scratch)
    return total


@parallel_kernel
def _loss_and_gradient(
    x,
    y,
    weights,
    gradient,
    height,
    width,
    pitch,
    plane_bytes,
    by_difference,
    by_similarity,
    scratch,
    similarity,
    difference,
):
    """``gradient`` times ``weights`` (one plane, or address 0); the sums of each strip in each band.

    ``similarity`` and ``difference`` are (channels, bands, strips) float64; ``scratch`` holds
    _SCRATCH_BYTES for each thread.
    """
    channels, bands, strips = similarity.shape
    for task in prange(channels * bands):
        flags = flush_denormals()
        own = scratch + get_thread_id() * _SCRATCH_BYTES
        channel, band = task // bands, task % bands
        top, bottom = band * _BAND_ROWS, min(height, (band + 1) * _BAND_ROWS)
        plane = channel * plane_bytes
        for strip in range(-1, strips + 1):
            left, middle = _derivatives_of(own, strip - 2), _derivatives_of(own, strip - 1)
            right = _derivatives_of(own, strip)
            if 0 <= strip < strips:
                similarity[channel, band, strip] = _similarity_strip(
                    x + plane, y + plane, right, strip * COLUMNS, height, width, pitch, top, bottom, own
                )
            else:
                _clear(right, _BAND_BYTES // VECTOR_BYTES)
            if strip > 0:
                difference[channel, band, strip - 1] = _gradient_strip(
                    x + plane,
                    y + plane,
                    left,
                    middle,
                    right,
                    weights,
                    gradient + plane,
                    (strip - 1) * COLUMNS,
                    height,
                    width,
                    pitch,
                    top,
                    bottom,
                    by_difference,
                    by_similarity,
                    own,
                )
        restore_denormals(flags)


class PhotometricLoss:
    """The loss of images of one size; its buffers are kept from call to call."""

    def __init__(self, height: int, width: int) -> None:
        self._shape = (height, width)
        self._sums = np.zeros((2, _CHANNELS, -(-height // _BAND_ROWS), -(-width // COLUMNS)))
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
        plane_bytes, pitch, _ = target.strides
        _loss_and_gradient(
            image.ctypes.data,
            target.ctypes.data,
            0 if weights is None else weights.ctypes.data,
            gradient.ctypes.data,
            *self._shape,
            pitch,
            plane_bytes,
            np.float32(scale * (1.0 - ssim_weight) / samples),
            np.float32(-scale * ssim_weight / samples),
            self._scratch.ctypes.data,
            similarity,
            difference,
        )
        loss = (1.0 - ssim_weight) * difference.sum() / samples
        return float(loss + ssim_weight * (1.0 - similarity.sum() / samples))

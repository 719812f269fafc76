"""The photometric loss of 3DGS, (1 - w) L1 + w (1 - SSIM), and its gradient in the image.

SSIM as in ``metrics``: 11x11 Gaussian window, zeros outside the image. The image is cut
into blocks; a block and its margin are blurred across, then down, in a scratch of fixed
layout, so that the inner loops are plain and long and the compiler vectorises them.
Interleaved channels stay so: the neighbour of a sample lies three samples further.
"""

from __future__ import annotations

import numpy as np

from .compiled import inlined, kernel, parallel_kernel, prange
from .metrics import SSIM_C1, SSIM_C2, SSIM_RADIUS_PX, ssim_window
from .projection import PARTS

_ROWS = 32
_COLUMNS = 96  # 32 pixels of three channels
_CHANNELS = 3
_MARGIN = SSIM_RADIUS_PX
_SIDE = _MARGIN * _CHANNELS
_WIDE = _COLUMNS + 2 * _SIDE
_TALL = _ROWS + 2 * _MARGIN

_ROW_PITCH = np.uint64(_WIDE + 2)
_BLURRED = np.uint64(5 * (_WIDE + 2))
_PLANE = np.uint64(_TALL * _COLUMNS)
_SCRATCH = 5 * (_WIDE + 2) + 5 * _TALL * _COLUMNS
_LINE = np.uint64(_COLUMNS)
_STEP = np.uint64(_CHANNELS)
_CENTRE = np.uint64(_SIDE)
_W0, _W1, _W2, _W3, _W4, _W5 = (np.float32(w) for w in ssim_window()[_MARGIN:])
_C1, _C2 = np.float32(SSIM_C1), np.float32(SSIM_C2)
_0, _1, _2 = np.float32(0), np.float32(1), np.float32(2)


@inlined
def _blur(s, i, step):
    """The window's weighted sum around index ``i`` (unsigned), samples ``step`` apart."""
    total = _W0 * s[i]
    total += _W1 * (s[i - step] + s[i + step])
    total += _W2 * (s[i - np.uint64(2) * step] + s[i + np.uint64(2) * step])
    total += _W3 * (s[i - np.uint64(3) * step] + s[i + np.uint64(3) * step])
    total += _W4 * (s[i - np.uint64(4) * step] + s[i + np.uint64(4) * step])
    return total + _W5 * (s[i - np.uint64(5) * step] + s[i + np.uint64(5) * step])


@kernel
def _load_line(s, plane, source, y, x0):
    """Copy a row's samples, from the margin before x0 on, zeros outside the image."""
    height, width = source.shape
    base = plane * (_WIDE + 2)
    if y < 0 or y >= height:
        for i in range(_WIDE):
            s[base + i] = _0
        return
    first, last = max(0, _SIDE - x0), min(_WIDE, width - x0 + _SIDE)
    row = source[y, x0 - _SIDE + first : x0 - _SIDE + last]
    for i in range(first):
        s[base + i] = _0
    for i in range(last - first):
        s[base + first + i] = row[i]
    for i in range(last, _WIDE):
        s[base + i] = _0


@kernel
def _blur_lines(s, planes, line):
    """Blur the loaded lines across, into row ``line`` of the blurred planes."""
    for plane in range(planes):
        source = np.uint64(plane) * _ROW_PITCH + _CENTRE
        target = _BLURRED + np.uint64(plane) * _PLANE + np.uint64(line) * _LINE
        for i in range(_LINE):
            s[target + i] = _blur(s, source + i, _STEP)


@kernel
def _multiply_lines(s):
    """From x and y in lines 0 and 1: their squares and product in lines 2, 3 and 4."""
    for i in range(_ROW_PITCH):
        x, y = s[i], s[i + _ROW_PITCH]
        s[i + np.uint64(2) * _ROW_PITCH] = x * x
        s[i + np.uint64(3) * _ROW_PITCH] = y * y
        s[i + np.uint64(4) * _ROW_PITCH] = x * y


@kernel
def _similarity_row(s, line, by_mean, by_square, by_product):
    """SSIM of one row, summed, and its derivatives in the blurred x, x^2 and x y."""
    base = _BLURRED + np.uint64(line + _MARGIN) * _LINE
    total = _0
    for k in range(by_mean.shape[0]):
        i = base + np.uint64(k)
        mean_x, mean_y = _blur(s, i, _LINE), _blur(s, i + _PLANE, _LINE)
        square_x = _blur(s, i + np.uint64(2) * _PLANE, _LINE)
        square_y = _blur(s, i + np.uint64(3) * _PLANE, _LINE)
        product = _blur(s, i + np.uint64(4) * _PLANE, _LINE)
        luminance = _2 * mean_x * mean_y + _C1
        structure = _2 * (product - mean_x * mean_y) + _C2
        power = mean_x * mean_x + mean_y * mean_y + _C1
        spread = square_x - mean_x * mean_x + square_y - mean_y * mean_y + _C2
        inverse = _1 / (power * spread)
        value = luminance * structure * inverse
        total += value
        by_mean[k] = _2 * (mean_y * (structure - luminance) - mean_x * value * (spread - power)) * inverse
        by_square[k] = -value / spread
        by_product[k] = _2 * luminance * inverse
    return total


@kernel
def _gradient_row(s, line, x, y, gradient, by_difference, by_similarity):
    """The loss' gradient of one row; returns its sum of absolute differences."""
    base = _BLURRED + np.uint64(line + _MARGIN) * _LINE
    total = _0
    for k in range(gradient.shape[0]):
        i = base + np.uint64(k)
        difference = x[k] - y[k]
        sign = _1 if difference > _0 else (-_1 if difference < _0 else _0)
        total += sign * difference
        similarity = _blur(s, i, _LINE)
        similarity += _2 * x[k] * _blur(s, i + _PLANE, _LINE) + y[k] * _blur(
            s, i + np.uint64(2) * _PLANE, _LINE
        )
        gradient[k] = by_difference * sign + by_similarity * similarity
    return total


@parallel_kernel
def _similarity(x, y, blocks_x, derivatives, sums):
    height, width = x.shape
    for part in prange(PARTS):
        s = np.zeros(_SCRATCH, np.float32)
        for block in range(part, sums.shape[0], PARTS):
            x0, y0 = block % blocks_x * _COLUMNS, block // blocks_x * _ROWS
            rows, last = min(_ROWS, height - y0), min(width, x0 + _COLUMNS)
            for line in range(rows + 2 * _MARGIN):
                _load_line(s, 0, x, y0 + line - _MARGIN, x0)
                _load_line(s, 1, y, y0 + line - _MARGIN, x0)
                _multiply_lines(s)
                _blur_lines(s, 5, line)
            total = 0.0
            for line in range(rows):
                total += _similarity_row(
                    s, line, derivatives[0, y0 + line, x0:last], derivatives[1, y0 + line, x0:last],
                    derivatives[2, y0 + line, x0:last],
                )  # fmt: skip
            sums[block] = total


@parallel_kernel
def _gradient(x, y, blocks_x, derivatives, by_difference, by_similarity, gradient, sums):
    height, width = x.shape
    for part in prange(PARTS):
        s = np.zeros(_SCRATCH, np.float32)
        for block in range(part, sums.shape[0], PARTS):
            x0, y0 = block % blocks_x * _COLUMNS, block // blocks_x * _ROWS
            rows, last = min(_ROWS, height - y0), min(width, x0 + _COLUMNS)
            for line in range(rows + 2 * _MARGIN):
                for plane in range(3):
                    _load_line(s, plane, derivatives[plane], y0 + line - _MARGIN, x0)
                _blur_lines(s, 3, line)
            total = 0.0
            for line in range(rows):
                row = y0 + line
                total += _gradient_row(
                    s,
                    line,
                    x[row, x0:last],
                    y[row, x0:last],
                    gradient[row, x0:last],
                    by_difference,
                    by_similarity,
                )
            sums[block] = total


class PhotometricLoss:
    """The loss of images of one size; its buffers are kept from call to call."""

    def __init__(self, height: int, width: int) -> None:
        self._samples = width * _CHANNELS
        self._blocks_x = -(-self._samples // _COLUMNS)
        blocks = self._blocks_x * -(-height // _ROWS)
        self._derivatives = np.empty((3, height, self._samples), np.float32)
        self._sums = np.empty((2, blocks))
        self._gradient = np.empty((height, width, _CHANNELS), np.float32)

    def __call__(self, image: np.ndarray, target: np.ndarray, ssim_weight: float) -> tuple[float, np.ndarray]:
        """The loss, and its gradient in ``image``; the next call overwrites the gradient.

        ``image`` and ``target`` are (H, W, 3) float32 and contiguous.
        """
        x, y = (values.reshape(-1, self._samples) for values in (image, target))
        similarity, difference = self._sums
        by_difference = np.float32((1.0 - ssim_weight) / x.size)
        by_similarity = np.float32(-ssim_weight / x.size)
        _similarity(x, y, self._blocks_x, self._derivatives, similarity)
        _gradient(
            x, y, self._blocks_x, self._derivatives, by_difference, by_similarity,
            self._gradient.reshape(x.shape), difference,
        )  # fmt: skip
        loss = (1.0 - ssim_weight) * difference.sum() / x.size
        return float(loss + ssim_weight * (1.0 - similarity.sum() / x.size)), self._gradient

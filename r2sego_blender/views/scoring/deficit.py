"""The asset deficit u of many views: the share of pixels whose alpha is too low.

A pixel's transmittance is the product of what its Gaussians let through, in any order. So
there is nothing to sort, no list of tiles, no colour and no depth: each Gaussian dims the
blocks of pixels that its ellipse touches, and a block in which every pixel's alpha has
passed the threshold is not visited again. A thread works on a whole view at a time.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba.core.types import float32, int64, void

from ...core.cameras import Camera
from ...splats.asset import SplatAsset
from ...splats.kernels.compiled import parallel_kernel, prange
from ...splats.kernels.packing import PackedGaussians
from ...splats.kernels.projection import (
    DILATION_PX2,
    EIGHTH,
    EIGHTH_SMALLEST,
    EXTENT_Y,
    FACTOR_A,
    FACTOR_B,
    FACTOR_C,
    INVERSE_A,
    LARGEST_ALPHA,
    RECORD_BYTES,
    SKEW_Y,
    U,
    V,
    lens_of,
    project_chunk,
)
from ...splats.kernels.tiles import BLOCK_PX
from ...splats.vector_language.aligned_memory import aligned
from ...splats.vector_language.denormals import flush_denormals, restore_denormals
from ...splats.vector_language.exponentials import EXP2_OF_EIGHTHS, exp2_of_eighths
from ...splats.vector_language.vectors import LANES, VECTOR_BYTES, Code, Value, vector_kernel

_LENS_FLOATS = 2 * LANES
_SETTLED_MARGIN = 1e-3
"""A pixel is settled when its transmittance is below what is asked for by this share."""

_SLACK_PX = 0.05
"""Blocks this near to an ellipse are visited, so that rounding loses no pixel."""

_SMALLEST_SQUARE = 1e-12
"""Below it the ellipse's row is a point; the slack is wider."""

_COLUMNS = [float(lane % BLOCK_PX) for lane in range(LANES)]
_ROWS = [float(lane // BLOCK_PX) for lane in range(LANES)]


class AlphaRenderer:
    """Renders the alpha of one asset, and nothing else, for many views of one size."""

    def __init__(self, asset: SplatAsset) -> None:
        self._gaussians = PackedGaussians.of(asset.with_degree(0))

    def missing_shares(
        self, cameras: Sequence[Camera], alpha_threshold: float, dilation_px2: float = DILATION_PX2
    ) -> np.ndarray:
        """(M,) float64: the share of each view's pixels whose alpha is below the threshold."""
        enough = np.float32(1.0 - alpha_threshold) * np.float32(1.0 - _SETTLED_MARGIN)
        planes = self._transmittances(cameras, enough, dilation_px2)
        pixels = cameras[0].width * cameras[0].height if cameras else 1
        return _count_missing(planes, np.float32(alpha_threshold)) / pixels

    def alphas(self, cameras: Sequence[Camera], dilation_px2: float = DILATION_PX2) -> np.ndarray:
        """(M, H, W) float32, the rasteriser's alpha within rounding, below 0.9999."""
        planes = self._transmittances(cameras, np.float32(0.0), dilation_px2)
        height, width = cameras[0].shape
        rows = planes.reshape(*planes.shape[:3], BLOCK_PX, BLOCK_PX).transpose(0, 1, 3, 2, 4)
        whole = rows.reshape(len(planes), planes.shape[1] * BLOCK_PX, planes.shape[2] * BLOCK_PX)
        return 1.0 - whole[:, :height, :width]

    def _transmittances(self, cameras: Sequence[Camera], enough: np.float32, dilation_px2: float) -> np.ndarray:
        """(M, blocks down, blocks across, 16) float32, the lanes a block's pixels row by row."""
        if len({camera.shape for camera in cameras}) > 1:
            raise ValueError("the views must have one size")
        height, width = cameras[0].shape if cameras else (1, 1)
        down, across = -(-height // BLOCK_PX), -(-width // BLOCK_PX)
        planes = aligned((len(cameras), down, across, LANES))
        lenses = aligned((len(cameras), _LENS_FLOATS))
        for row, camera in zip(lenses, cameras, strict=True):
            lens = lens_of(camera, dilation_px2)
            row[: len(lens)] = lens
        values = self._gaussians.values
        records = aligned((max(len(cameras), 1), LANES, LANES))
        _render(
            values.ctypes.data,
            len(values),
            values.strides[0],
            lenses.ctypes.data,
            len(cameras),
            height,
            width,
            enough,
            records.ctypes.data,
            planes.ctypes.data,
            planes.strides[0],
        )
        return planes


@vector_kernel(void(int64, int64, int64))
def _open(code: Code, plane: Value, width: Value, height: Value) -> None:
    """All light comes through; none where a block reaches beyond the image."""
    columns, rows = code.vector(_COLUMNS), code.vector(_ROWS)
    across, down = (width + BLOCK_PX - 1) >> 2, (height + BLOCK_PX - 1) >> 2
    with code.loop(down) as row, code.loop(across) as column:
        inside = columns < code.to_floats(width - column * BLOCK_PX)
        inside = inside & (rows < code.to_floats(height - row * BLOCK_PX))
        code.store(plane + (row * across + column) * VECTOR_BYTES, code.select(inside, 1.0, 0.0))


@vector_kernel(void(int64, int64, int64, int64, float32))
def _dim(code: Code, record: Value, plane: Value, width: Value, height: Value, enough: Value) -> None:
    """Let a Gaussian take its light from the blocks it touches and that still have enough."""

    def field(place: int) -> Value:
        return code.load_float(record + 4 * place)

    u, v, a, b, c = (field(place) for place in (U, V, FACTOR_A, FACTOR_B, FACTOR_C))
    eighth, inverse_a, extent_y, skew = (field(place) for place in (EIGHTH, INVERSE_A, EXTENT_Y, SKEW_Y))
    level, tilt = eighth - EIGHTH_SMALLEST, b * inverse_a
    along_row = code.vector(_COLUMNS) * a + code.vector(_ROWS) * b
    down_rows, next_block = code.vector(_ROWS) * c, code.spread(a * BLOCK_PX)
    across = (width + BLOCK_PX - 1) >> 2
    constants = [code.vector(number) for number in EXP2_OF_EIGHTHS]

    def block_at(px: Value, size: Value) -> Value:
        """The block of the pixel whose centre is the first at ``px`` or before."""
        return code.to_long(code.minimum(code.maximum(px - 0.5, 0.0), code.to_floats(size - 1))) >> 2

    row = code.variable(block_at(v - extent_y - _SLACK_PX, height))
    last_row = block_at(v + extent_y + _SLACK_PX, height)
    with code.loop_while(lambda: row.get() <= last_row):
        # The ellipse within the row of blocks: dy between top and bottom, dx between left and right.
        from_top = code.to_floats(row.get() * BLOCK_PX) + 0.5 - v
        top = code.maximum(from_top - _SLACK_PX, -extent_y)
        bottom = code.minimum(from_top + (BLOCK_PX - 1.0 + _SLACK_PX), extent_y)

        def reach(dy: Value, top: Value = top, bottom: Value = bottom) -> tuple[Value, Value]:
            """Half the width, and the middle, of the ellipse at ``dy`` held in the row."""
            held = code.minimum(code.maximum(dy, top), bottom)
            f = held * c
            return code.sqrt(code.maximum(level - f * f, _SMALLEST_SQUARE)) * inverse_a, held * tilt

        (half_right, middle_right), (half_left, middle_left) = reach(skew), reach(-skew)
        first = block_at(u - half_left - middle_left - _SLACK_PX, width)
        last = block_at(u + half_right - middle_right + _SLACK_PX, width)
        from_left = code.to_floats(first * BLOCK_PX) + 0.5 - u
        e0 = code.fma(code.spread(from_left), a, code.fma(code.spread(from_top), b, along_row))
        f = code.fma(code.spread(from_top), c, down_rows)
        above = code.fma(-f, f, code.spread(eighth))
        place = plane + (row.get() * across + first) * VECTOR_BYTES
        with code.loop(last - first + 1) as block:
            at = place + block * VECTOR_BYTES
            light = code.load(at)
            with code.when(code.bits(light > enough).differs(0)):
                e = code.fma(next_block, code.to_floats(block), e0)
                exponent = code.fma(-e, e, above)
                alpha = code.minimum(exp2_of_eighths(exponent, constants), LARGEST_ALPHA)
                alpha = code.select(exponent >= EIGHTH_SMALLEST, alpha, 0.0)
                code.store(at, code.fma(-alpha, light, light))
        row.add(code.long(1))


@parallel_kernel
def _render(chunks, count, chunk_bytes, lenses, views, height, width, enough, records, planes, plane_bytes):
    """Fill each view's plane of transmittances; all but sizes and ``enough`` are addresses."""
    for view in prange(views):
        state = flush_denormals()
        plane, record = planes + view * plane_bytes, records + view * LANES * RECORD_BYTES
        _open(plane, width, height)
        for chunk in range(count):
            visible = project_chunk(
                chunks + chunk * chunk_bytes, chunk_bytes, 0, lenses + view * _LENS_FLOATS * 4, record
            )
            lane = 0
            while visible:
                if visible & 1:
                    _dim(record + lane * RECORD_BYTES, plane, width, height, enough)
                visible >>= 1
                lane += 1
        restore_denormals(state)


@parallel_kernel
def _count_missing(planes, threshold):
    """(M,) int64: the pixels of each view whose alpha is below the threshold."""
    views, down, across, lanes = planes.shape
    counts = np.zeros(views, np.int64)
    for view in prange(views):
        count = 0
        for row in range(down):
            for column in range(across):
                for lane in range(lanes):
                    count += np.float32(1.0) - planes[view, row, column, lane] < threshold
        counts[view] = count
    return counts

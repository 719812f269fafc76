"""What blending reads of a batch, against the formula of the exponent in float64."""

from __future__ import annotations

import numba
import numpy as np
from made_up_batch import ENTRIES, MIDDLE, made_up_entries, made_up_records, pixel_centres
from numba.core.types import int64, void

from r2sego_blender.splats.kernels.batches import BATCH, FETCHED_BYTES, Fetched, fetch
from r2sego_blender.splats.kernels.projection import DEPTH, EIGHTH, FACTOR_A, FACTOR_B, FACTOR_C, RED, U, V
from r2sego_blender.splats.kernels.tiles import BLOCKS
from r2sego_blender.splats.vector_language.aligned_memory import aligned
from r2sego_blender.splats.vector_language.vectors import LANES, VECTOR_BYTES, vector_kernel

_UNTOUCHED = -7.0
_FOUND = 3  # vectors of each block: e, f and the exponent's eighth
_TOLD = 6  # vectors of each entry: its opacity, red, green, blue, depth, its blocks


@vector_kernel(void(int64, int64, int64, int64))
def _told(code, batch, count, exponents, fields):
    with code.loop(count) as i:
        entry = Fetched(code, batch + i * FETCHED_BYTES, depth=True)
        of_entry = fields + i * (_TOLD * VECTOR_BYTES)
        for k, value in enumerate([code.spread(entry.opacity_eighth), *entry.colour]):
            code.store(of_entry + k * VECTOR_BYTES, value)
        code.store_long(of_entry + (_TOLD - 1) * VECTOR_BYTES, entry.blocks)
        with code.loop(code.long(BLOCKS)) as block:
            of_block = exponents + (i * BLOCKS + block) * (_FOUND * VECTOR_BYTES)
            for k, value in enumerate(entry.exponent(block)):
                code.store(of_block + k * VECTOR_BYTES, value)


@numba.njit
def _fetch_and_tell(order, count, entries, records, batch, exponents, fields):
    fetch(order, count, entries, records, MIDDLE[0], MIDDLE[1], batch)
    _told(batch, count, exponents, fields)


def _fetched(order: np.ndarray, entries: np.ndarray, records: np.ndarray) -> tuple[np.ndarray, ...]:
    """The batch, what it says of e, f and the exponent at each block's pixels, and of each entry."""
    batch = aligned((BATCH, FETCHED_BYTES // 4))
    batch[:] = _UNTOUCHED
    exponents, fields = aligned((BATCH, BLOCKS, _FOUND, LANES)), aligned((BATCH, _TOLD, LANES))
    given = (order.ctypes.data, len(order), entries.ctypes.data, records.ctypes.data)
    _fetch_and_tell(*given, batch.ctypes.data, exponents.ctypes.data, fields.ctypes.data)
    return batch, exponents, fields


def test_a_batch_holds_its_entries_in_the_order_of_depth() -> None:
    rng = np.random.default_rng(0)
    records, entries = made_up_records(rng), made_up_entries(rng)
    depth_ranks = rng.permutation(ENTRIES)
    order = (rng.integers(0, 2**31, ENTRIES) << 32 | depth_ranks)[:BATCH].astype(np.int64)
    _, exponents, fields = _fetched(order, entries, records)

    taken = entries[depth_ranks[:BATCH]]
    of = records[taken["gaussian"]].astype(np.float64)
    for k, field in enumerate((EIGHTH, RED, RED + 1, RED + 2, DEPTH)):
        assert (fields[:, k] == of[:, [field]]).all()
    assert (fields[:, _TOLD - 1, :2].copy().view(np.int64)[:, 0] == taken["blocks"]).all()

    x, y = pixel_centres()
    places = (FACTOR_A, FACTOR_B, FACTOR_C, U, V, EIGHTH)
    a, b, c, u, v, eighth = (of[:, place, None, None] for place in places)
    e, f = a * (x - u) + b * (y - v), c * (y - v)
    # Places of some hundred pixels are exact to 2e-5, factors below 4, sums below 200.
    np.testing.assert_allclose(exponents[:, :, 0], e, rtol=0, atol=2e-4)
    np.testing.assert_allclose(exponents[:, :, 1], f, rtol=0, atol=2e-4)
    near = e * e + f * f < 10.0  # farther away nothing is blended
    np.testing.assert_allclose(exponents[:, :, 2][near], (eighth - e * e - f * f)[near], rtol=0, atol=1e-3)
    assert near.mean() > 0.05


def test_fetching_fewer_leaves_the_rest_of_a_batch() -> None:
    rng = np.random.default_rng(1)
    records, entries = made_up_records(rng), made_up_entries(rng)
    batch, _, _ = _fetched(np.arange(5), entries, records)
    assert (batch[5:] == _UNTOUCHED).all()
    assert (batch[:5, RED] == records[entries["gaussian"][:5], RED]).all()

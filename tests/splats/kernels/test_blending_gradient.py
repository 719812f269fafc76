"""An entry's gradient sums, in each of the ways they are added up, against float64."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numba
import numpy as np
import pytest
from made_up_batch import MIDDLE, made_up_entries, made_up_records, pixel_centres
from numba.core.types import int64, void

from r2sego_blender.splats.kernels.batches import BATCH, BATCH_BYTES, SLOT_BYTES, fetch
from r2sego_blender.splats.kernels.blending import FINISHED, TABLE
from r2sego_blender.splats.kernels.blending_gradient import BLENDED, GRADIENTS_BYTES, MOMENTS, write_blend_gradient
from r2sego_blender.splats.kernels.projection import (
    DEPTH,
    EIGHTH,
    FACTOR_A,
    FACTOR_B,
    FACTOR_C,
    LARGEST_ALPHA,
    RED,
    U,
    V,
)
from r2sego_blender.splats.kernels.tiles import BLOCK_BYTES, BLOCKS, REST, UPSTREAM
from r2sego_blender.splats.vector_language.aligned_memory import aligned
from r2sego_blender.splats.vector_language.vectors import LANES, vector_kernel

_ALIVE = 0x7FFF_F0FF_FFFF_FFFF  # some blocks are finished
_UNTOUCHED = -7.0


@functools.cache
def _filling(depth: bool, sum_lanes: int) -> Callable:
    """A function that fetches a batch and fills its slots, compiled to add up in ``sum_lanes``."""

    @vector_kernel(void(*[int64] * 9))
    def body(code, state, table, batch, count, alive, order, entries, records, slots):
        write_blend_gradient(
            code, depth, sum_lanes, state, table, batch, count, alive, order, count, entries, records, slots
        )

    @numba.njit
    def fill(state, table, batch, count, alive, order, entries, records, slots):
        fetch(order, count, entries, records, MIDDLE[0], MIDDLE[1], batch)
        body(state, table, batch, count, alive, order, entries, records, slots)

    return fill


def _inputs(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Records, a batch's entries, and a tile's state (64, 7, 16) with gradients and a rest."""
    rng = np.random.default_rng(seed)
    records, entries = made_up_records(rng), made_up_entries(rng)[:BATCH]
    records[:, EIGHTH] = rng.uniform(-0.6, 0.2, len(records))  # of alpha between 0.04 and above 0.99
    records[:, EIGHTH] = np.minimum(records[:, EIGHTH], 0.0)
    for field in (FACTOR_A, FACTOR_B, FACTOR_C):
        records[:, field] *= 0.3
    entries["blocks"][3] = 0
    entries["blocks"][4] = 1 << 44  # a finished block alone
    state = aligned((BLOCKS, BLOCK_BYTES // 4 // LANES, LANES))
    state[:] = rng.normal(size=state.shape)
    state[:, 0] = rng.uniform(0.5, 1.0, (BLOCKS, LANES))
    state[:, 0][rng.random((BLOCKS, LANES)) < 0.1] = 0.5 * FINISHED
    return records, entries, state


def _expected(records: np.ndarray, entries: np.ndarray, state: np.ndarray, channels: int) -> np.ndarray:
    """(entries, 11) float64: the slots by the formulas, and beside them the sums of absolute values."""
    x, y = pixel_centres()
    transmittance = state[:, 0].astype(np.float64)
    rest = transmittance * state[:, REST]  # as seen through what is in front
    upstream = state[:, UPSTREAM : UPSTREAM + channels].astype(np.float64)
    colours = (RED, RED + 1, RED + 2, DEPTH)[:channels]
    slots = np.zeros((2, len(entries), MOMENTS + 1))
    for number, entry in enumerate(entries):
        visited = (int(entry["blocks"]) & _ALIVE) >> np.arange(BLOCKS, dtype=object) & 1
        visited = visited.astype(bool)
        if not visited.any():
            continue
        record = records[entry["gaussian"]].astype(np.float64)
        a, b, c, u, v, eighth = record[[FACTOR_A, FACTOR_B, FACTOR_C, U, V, EIGHTH]]
        e, f = a * (x - u) + b * (y - v), c * (y - v)
        exponent = eighth - e * e - f * f
        alpha = 2.0 ** (8.0 * np.maximum(exponent, -100.0))
        taken = visited[:, None] & (alpha >= 1.0 / 255.0) & (transmittance > FINISHED)
        weight = np.where(taken, np.minimum(alpha, LARGEST_ALPHA) * transmittance, 0.0)
        transmittance = transmittance - weight
        shade = np.einsum("bkl,k->bl", upstream, record[list(colours)])
        rest = rest - weight * shade
        behind = np.where(taken, transmittance, 1.0)
        gradient = np.where(alpha < LARGEST_ALPHA, weight * (shade - rest / behind), 0.0)
        moments = [gradient * m for m in (1.0, e, f, e * e, e * f, exponent)]
        terms = np.stack([*moments, *(weight * upstream[:, k] for k in range(channels))])
        for told, values in zip(slots, (terms, np.abs(terms)), strict=True):
            told[number, : len(terms)] = values.sum(axis=(1, 2))
            told[number, BLENDED] = 1.0
    return slots


def _filled(depth: bool, sum_lanes: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A batch's slots, and the state that its entries leave."""
    records, entries, state = _inputs(seed)
    order, slots = np.arange(BATCH), aligned((BATCH, SLOT_BYTES // 4))
    slots[:] = _UNTOUCHED
    batch = aligned((BATCH_BYTES + GRADIENTS_BYTES,), np.uint8)
    _filling(depth, sum_lanes)(
        state.ctypes.data,
        TABLE.ctypes.data,
        batch.ctypes.data,
        BATCH,
        _ALIVE,
        order.ctypes.data,
        entries.ctypes.data,
        records.ctypes.data,
        slots.ctypes.data,
    )
    return slots[:, : MOMENTS + 1], state


@pytest.mark.parametrize("depth", [False, True])
@pytest.mark.parametrize("sum_lanes", [4, 8, 16])
def test_an_entrys_sums_equal_the_formulas(depth: bool, sum_lanes: int) -> None:
    blended = 0
    for seed in range(4):
        expected, size = _expected(*_inputs(seed), 4 if depth else 3)
        slots, _ = _filled(depth, sum_lanes, seed)
        # Places of some hundred pixels are exact to 2e-5: a pixel on the ellipse's edge may differ.
        assert (np.abs(slots - expected) <= 2e-4 * size + 2e-3).all()
        assert (slots[:, BLENDED] == expected[:, BLENDED]).all()
        blended += (size[:, 1] > 1.0).sum()
    assert blended > 60


@pytest.mark.parametrize("sum_lanes", [4, 8])
def test_each_way_leaves_the_same_state(sum_lanes: int) -> None:
    (slots, state), (usual_slots, usual_state) = (_filled(True, n, seed=9) for n in (sum_lanes, LANES))
    assert (state == usual_state).all()
    np.testing.assert_allclose(slots, usual_slots, rtol=1e-4, atol=1e-3)

from __future__ import annotations

import numba
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.splats.kernels.compiled import dealt, turns


@numba.njit
def pieces_of(pieces: int, run: int, threads: int) -> np.ndarray:
    each = turns(pieces, run, threads)
    return np.array([dealt(number, each, run, threads) for number in range(each * threads)])


@settings(deadline=None, derandomize=True)
@given(st.integers(1, 700), st.integers(1, 9), st.integers(1, 33))
def test_every_piece_is_dealt_once_in_runs_and_evenly(pieces: int, run: int, threads: int) -> None:
    dealt_pieces = pieces_of(pieces, run, threads)
    real = dealt_pieces[dealt_pieces < pieces]
    assert sorted(real) == list(range(pieces))
    hands = dealt_pieces.reshape(threads, -1)
    assert hands.shape[1] * threads - pieces < run * threads + run
    runs = hands.reshape(threads, -1, run)
    np.testing.assert_array_equal(runs - runs[..., :1], np.broadcast_to(np.arange(run), runs.shape))
    held = (hands < pieces).sum(axis=1)
    assert held.max() - held.min() <= run

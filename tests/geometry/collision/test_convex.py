"""Cutting into convex pieces: which flats may be joined."""

import tracemalloc

import numpy as np
import pytest

from r2sego_blender.geometry.collision import convex


def boxes(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    lows = rng.uniform(0.0, 5.0, (count, 3))
    return lows, lows + rng.uniform(0.0, 1.0, (count, 3))


@pytest.mark.parametrize("at_once", [1, 1000, 10**9])
def test_touching_boxes_are_found_as_by_looking_at_every_pair(monkeypatch, at_once):
    rng = np.random.default_rng(4)
    monkeypatch.setattr(convex, "_PAIRS_AT_ONCE", at_once)
    lows, highs = boxes(rng, 120)
    for among in (np.arange(120), np.flatnonzero(rng.random(120) < 0.5), np.arange(1), np.arange(0)):
        first, second = among[np.array(np.triu_indices(len(among), 1))]
        touch = (lows[first] <= highs[second] + 1e-3) & (lows[second] <= highs[first] + 1e-3)
        expected = np.stack([first, second])[:, touch.all(1)]
        np.testing.assert_array_equal(convex._touching(lows, highs, among), expected)


def test_pairs_of_many_pieces_do_not_fill_the_memory():
    lows, _ = boxes(np.random.default_rng(5), 8000)
    tracemalloc.start()
    try:
        convex._touching(100.0 * lows, 100.0 * lows + 1.0, np.arange(8000))
        assert tracemalloc.get_traced_memory()[1] < 100e6  # their 32 million pairs alone take 512 MB
    finally:
        tracemalloc.stop()

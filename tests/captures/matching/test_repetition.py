"""What repeats in a room joins no photographs."""

from __future__ import annotations

import numpy as np
import pytest

from r2sego_blender.captures.matching.features import Features, match
from r2sego_blender.captures.matching.overlap import Matched
from r2sego_blender.captures.matching.repetition import confirmed_sift, without_repetition

SIZE, SHIFT = (400, 300), np.array([60.0, -8.0])
NONE = np.zeros((0, 128), np.uint8)


def _pair(rng, distinct, shift):
    """SIFT features of two photographs, so many distinct, moved by ``SHIFT``, and matches moved by ``shift``."""
    places = rng.uniform((70, 20), (330, 280), (80, 2))
    descriptors = rng.integers(0, 200, (80, 128)).astype(np.uint8)
    others = rng.integers(0, 200, (80, 128)).astype(np.uint8)
    others[:distinct] = descriptors[:distinct]
    sift = [Features(places.astype(np.float32), descriptors), Features((places + SHIFT).astype(np.float32), others)]
    found = Matched(
        [Features(places.astype(np.float32), NONE), Features((places + shift).astype(np.float32), NONE)],
        {(0, 1): np.stack([np.arange(80)] * 2, axis=1).astype(np.int32)},
    )
    return sift, found


@pytest.mark.parametrize(("distinct", "kept"), [(0, False), (2, False), (3, True), (40, True)])
def test_a_pair_is_kept_where_distinct_features_move_as_it_says(rng, distinct, kept):
    sift, found = _pair(rng, distinct, SHIFT)
    told = without_repetition(found, Matched(sift, {}), [SIZE] * 2, 0.8)
    assert list(told.pairs) == [(0, 1)] * kept
    assert told.features is found.features


@pytest.mark.parametrize("shift", [(0.0, 0.0), (60.0, 30.0), (-60.0, -8.0)])
def test_a_pair_whose_distinct_features_move_otherwise_is_a_pattern_that_repeats(rng, shift):
    sift, found = _pair(rng, 40, np.array(shift))
    assert not without_repetition(found, Matched(sift, {}), [SIZE] * 2, 0.8).pairs


def test_matches_that_are_known_already_tell_the_same(rng):
    sift, found = _pair(rng, 40, SHIFT)
    known = Matched(sift, {(0, 1): match(sift[0].descriptors, sift[1].descriptors, 0.8)})
    assert list(without_repetition(found, known, [SIZE] * 2, 0.8).pairs) == [(0, 1)]
    none = Matched(sift, {(0, 1): known.pairs[0, 1][:2]})
    assert not without_repetition(found, none, [SIZE] * 2, 0.8).pairs


def test_photographs_without_features_confirm_nothing(rng):
    _, found = _pair(rng, 40, SHIFT)
    empty = [Features(np.zeros((0, 2), np.float32), NONE)] * 2
    assert not without_repetition(found, Matched(empty, {}), [SIZE] * 2, 0.8).pairs


def test_few_matches_of_sift_count_but_where_both_photographs_have_surer_ones(rng):
    sift, found = _pair(rng, 40, SHIFT)
    rows = {count: np.stack([rng.integers(0, 80, count)] * 2, axis=1).astype(np.int32) for count in (15, 99, 100)}
    pairs = {(0, 1): rows[15], (0, 2): rows[99], (1, 2): rows[15], (2, 3): rows[100], (1, 4): rows[15]}
    by_sift = Matched([*sift, *sift, *sift], pairs)
    told = confirmed_sift(by_sift, found)  # which has the first pair
    assert list(told.pairs) == [(0, 1), (2, 3), (1, 4)] and told.features is by_sift.features
    assert all(told.pairs[pair] is pairs[pair] for pair in told.pairs)

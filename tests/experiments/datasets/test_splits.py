"""Captures and held-out frames: the published rule, and equal spaces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from expected_errors import refused
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.core.errors import ExperimentError
from r2sego_blender.experiments.datasets.splits import around, equally_spaced


@given(st.integers(2, 400).flatmap(lambda size: st.tuples(st.just(size), st.integers(2, size))))
def test_equal_spaces_go_from_the_first_to_the_last_and_differ_by_one_at_most(sizes):
    size, count = sizes
    found = equally_spaced(range(size), count, Path("walk"))
    assert found[0] == 0 and found[-1] == size - 1 and len(set(found)) == count
    assert np.ptp(np.diff(found)) <= 1


def test_more_than_there_are_is_refused():
    with refused(ExperimentError, "walk", "3", "4"):
        equally_spaced(range(3), 4, Path("walk"))


@given(st.sets(st.integers(0, 899), min_size=1, max_size=9), st.integers(1, 80), st.integers(1, 20))
def test_held_out_frames_are_near_a_capture_and_are_none(captures, reach, step):
    found = around(captures, 900, reach, step)
    assert found == sorted(set(found)) and not set(found) & captures
    assert all(0 <= one < 900 and min(abs(one - other) for other in captures) <= reach for one in found)


def test_the_rule_is_that_of_the_published_splits():
    """A capture in the middle, one near the begin, whose lists are one, and one near the end."""
    assert around([244], 900, 50, 10) == [*range(194, 244, 10), *range(245, 294, 10)]
    assert around([5], 900, 50, 10) == [0, 11, 21, 31, 41, 51]
    assert around([890], 900, 50, 10) == [*range(840, 890, 10), 891]

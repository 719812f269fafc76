"""The statistics give the paper's own numbers from its counts, and what theory says of others."""

from __future__ import annotations

import numpy as np
import pytest
from expected_errors import refused
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from r2sego_blender.core.errors import EvaluationError
from r2sego_blender.policy.statistics import compare_pairs, lines

BASELINE, REFINED = (0, 0, 1, 2, 1), (7, 7, 7, 6, 6)  # of 8: the paper's table
COUNTS = st.lists(st.tuples(st.integers(0, 8), st.integers(0, 8)), min_size=2, max_size=5)


def percent(*values: float) -> list[float]:
    return [round(100 * value, 1) for value in values]


def test_the_papers_numbers_come_from_its_counts():
    found = compare_pairs(BASELINE, REFINED, 8)
    assert percent(found.first.mean, found.first.std) == [10.0, 10.5]
    assert percent(found.second.mean, found.second.std) == [82.5, 6.8]
    assert percent(found.difference, *found.interval) == [72.5, 52.3, 92.7]
    assert (found.sign_greater, found.sign_two_sided) == (0.03125, 0.0625)
    assert (found.permutation_greater, found.permutation_two_sided) == (0.03125, 0.0625)
    assert percent(*found.first.pooled) == [2.8, 23.7] and percent(*found.second.pooled) == [67.2, 92.7]
    assert percent(*found.bootstrapped) == pytest.approx([52.5, 90.0], abs=2.6)  # in steps of 2.5
    assert found.least_two_sided_p == 0.0625


def test_equal_sums_are_equal_whatever_the_episodes():
    """14 and 3 of 18 against 10 and 7: two of the four flips of signs reach what is seen exactly, one more is above."""
    found = compare_pairs((14, 3), (10, 7), 18)
    assert found.permutation_greater == 0.75 and found.permutation_two_sided == 1.0 and found.difference == 0.0


def test_five_pairs_are_told_that_they_cannot_show_it_two_sided_and_six_are_not():
    assert "impossible" in lines(compare_pairs(BASELINE, REFINED, 8), ("baseline", "refined"))[-1]
    six = lines(compare_pairs((*BASELINE, 0), (*REFINED, 8), 8), ("baseline", "refined"))
    assert not any("impossible" in line for line in six)


@settings(max_examples=25, deadline=None)
@given(COUNTS, st.integers(0, 3))
def test_it_is_what_scipy_and_a_full_enumeration_say(pairs, seed):
    first, second = zip(*pairs, strict=True)
    found = compare_pairs(first, second, 8, seed)
    apart = (np.array(second) - np.array(first)) / 8
    flips = np.array(np.meshgrid(*[[-1, 1]] * len(apart))).reshape(len(apart), -1)
    means = apart @ flips / len(apart)
    greater, less = ((means >= apart.mean() - 1e-12).mean(), (means <= apart.mean() + 1e-12).mean())
    assert found.permutation_greater == pytest.approx(greater)
    assert found.permutation_two_sided == pytest.approx(min(1.0, 2 * min(greater, less)))
    better, worse = int((apart > 0).sum()), int((apart < 0).sum())
    assert found.sign_greater == pytest.approx(stats.binom.sf(better - 1, better + worse, 0.5))
    if apart.std() > 0:
        assert found.interval == pytest.approx(stats.ttest_rel(second, first).confidence_interval(0.95) / np.array(8.0))
    assert found.permutation_two_sided >= found.least_two_sided_p - 1e-12
    assert found == compare_pairs(first, second, 8, seed)


def test_twenty_pairs_are_permuted_by_a_seeded_draw():
    found = compare_pairs([1] * 20, [5] * 20, 8, seed=4)
    assert 0.0 < found.permutation_greater < 1e-3 and found.interval == pytest.approx((0.5, 0.5))
    assert found == compare_pairs([1] * 20, [5] * 20, 8, seed=4)


@pytest.mark.parametrize(("first", "second"), [((1,), (2,)), ((1, 2), (1, 2, 3)), ((1, 9), (1, 2)), ((1, -1), (1, 2))])
def test_what_cannot_be_compared_is_refused(first, second):
    with refused(EvaluationError, "successes"):
        compare_pairs(first, second, 8)


@pytest.mark.parametrize("episodes", [0, -1])
def test_without_episodes_there_is_no_rate(episodes):
    with refused(EvaluationError, "episodes"):
        compare_pairs((0, 0), (0, 0), episodes)


def test_a_truth_value_is_a_count_of_one_episode_in_either_arm():
    numbers = compare_pairs((0, 1, 0), (1, 1, 1), 1)
    assert compare_pairs((False, True, False), (True, True, True), 1) == numbers
    assert compare_pairs((False, True, False), (1, 1, 1), 1) == numbers

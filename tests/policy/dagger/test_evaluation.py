"""Success rates with their exact intervals, and the kinds of failure."""

from __future__ import annotations

import pytest

from r2sego_blender.policy.dagger.episodes import Outcome
from r2sego_blender.policy.dagger.evaluation import Evaluation


def test_the_intervals_are_the_paper_s():
    for successes, low, high in ((4, 0.028, 0.237), (33, 0.672, 0.927)):
        failures = ["missed_target"] * (40 - successes)
        outcomes = [Outcome(n, f, 10, 2.0) for n, f in enumerate([""] * successes + failures)]
        found = Evaluation.of(outcomes)
        assert (found.successes, found.episodes) == (successes, 40)
        assert (round(found.low, 3), round(found.high, 3)) == (low, high)


def test_failures_are_counted_by_kind_and_assist_is_the_episodes_mean():
    found = Evaluation.of(Outcome(n, kind, 1, n) for n, kind in enumerate(["", "fall", "time_out", "fall"]))
    assert list(found.failures.items()) == [("fall", 2), ("time_out", 1)]
    assert found.rate == 0.25
    assert found.mean_assist_n == pytest.approx(1.5)

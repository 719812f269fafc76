"""The paper's numbers come out of its counts, to the digit."""

import math
import statistics
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.trials.tables.statistics import Difference, Spread, percent


def rates(successes, trials):
    return [Fraction(count, trials) for count in successes]


@pytest.mark.parametrize(
    ("successes", "trials", "told"),
    [
        ((0, 0, 1, 2, 1), 8, ("10.0", "10.5")),
        ((7, 7, 7, 6, 6), 8, ("82.5", "6.8")),
        ((20, 22, 21, 23, 23), 25, ("87.2", "5.2")),
        ((25, 24, 24, 25, 24), 25, ("97.6", "2.2")),
        ((3,), 8, ("37.5", "")),
        ((1, 1), 16, ("6.3", "0.0")),  # 6.25: half goes up
    ],
)
def test_means_and_sample_deviations(successes, trials, told):
    assert Spread.of(rates(successes, trials)).texts == told


def test_the_difference_has_one_direction_for_all_five_seeds():
    difference = Difference.of(rates((7, 7, 7, 6, 6), 8), rates((0, 0, 1, 2, 1), 8))
    assert (difference.higher, difference.lower, difference.spread.mean) == (5, 0, Fraction(29, 40))
    points = [87.5, 87.5, 75.0, 50.0, 62.5]
    assert difference.spread.texts == ("72.5", f"{statistics.stdev(points):.1f}")
    mixed = Difference.of(rates((1, 2, 3), 8), rates((2, 2, 2), 8))
    assert (mixed.higher, mixed.lower, mixed.spread.mean) == (1, 1, 0)


@given(st.integers(1, 200).flatmap(lambda n: st.lists(st.integers(0, n).map(lambda k: Fraction(k, n)), min_size=2)))
def test_as_the_standard_library_has_it(given_rates):
    spread = Spread.of(given_rates)
    assert spread.mean == statistics.mean(given_rates)
    assert math.isclose(float(spread.variance), statistics.variance(map(float, given_rates)), abs_tol=1e-12)
    mean, deviation = map(float, spread.texts)
    assert abs(mean - 100 * spread.mean) <= Fraction(51, 1000)
    assert abs(deviation - 100 * math.sqrt(spread.variance)) <= 0.051


def test_without_rates_there_is_no_mean():
    assert Spread.of([]) is None and Difference.of([], []) is None


def test_a_half_goes_away_from_nothing():
    assert [percent(Fraction(value, 2000)) for value in (1, -1, 0, 3)] == ["0.1", "-0.1", "0.0", "0.2"]

"""Paired comparisons of success rates: one policy trained per arm and seed, so many episodes each.

The seed is the replicate: its two policies share initialisation, teacher data and order, so the tests are of the
differences within pairs. Episodes of one policy are no replicates; what pools them is descriptive. With five pairs the
smallest two-sided p of a sign or exact permutation test is 2 / 2^5 = 0.0625: p < 0.05 is impossible, whatever is seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..core.errors import EvaluationError
from ..core.statistics import CONFIDENCE, Interval, student_interval

_EXACT_UP_TO = 14  # pairs; of more so many sign flips are drawn as these have
_BOOTSTRAPS = 10_000

_SIDES = ("greater", "two-sided")


@dataclass(frozen=True)
class Arm:
    """``successes`` (pairs,) int of ``episodes`` each, with their ``mean`` and sample standard deviation of rates.

    ``pooled`` is Clopper and Pearson's interval of all episodes together: descriptive, for seeds differ.
    """

    successes: tuple[int, ...]
    episodes: int
    mean: float
    std: float
    pooled: Interval


@dataclass(frozen=True)
class PairedComparison:
    """Two arms over the same seeds; rates and their differences, second less first, from 0 to 1.

    ``interval`` is Student's of the paired difference, ``bootstrapped`` the percentiles of a hierarchical bootstrap of
    seeds and then of episodes. P-values ask for a second arm that is better (``_greater``) or another.
    """

    first: Arm
    second: Arm
    difference: float
    interval: Interval
    sign_greater: float
    sign_two_sided: float
    permutation_greater: float
    permutation_two_sided: float
    bootstrapped: Interval

    @property
    def pairs(self) -> int:
        """How many seeds there are."""
        return len(self.first.successes)

    @property
    def least_two_sided_p(self) -> float:
        """What a sign or permutation test of so many pairs cannot go below."""
        return float(2.0 ** (1 - self.pairs))


def compare_pairs(first: Sequence[int], second: Sequence[int], episodes: int, seed: int = 0) -> PairedComparison:
    """Compare successes of ``episodes`` each, pair by pair in the same order.

    ``seed`` is the bootstrap's, and the permutations' of more than 14 pairs. Raises EvaluationError for arms of
    different length, fewer than two pairs, counts that are no whole numbers from 0 to ``episodes``, or no episodes.
    """
    from scipy import stats

    if episodes < 1:
        raise EvaluationError(f"{episodes} episodes have no rate", where="episodes", cure="Give 1 or more.")
    counts = np.array([list(first), list(second)]) if len(first) == len(second) else np.zeros((2, 0))
    if counts.shape[1] < 2 or counts.dtype.kind not in "biu" or counts.min() < 0 or counts.max() > episodes:
        raise EvaluationError(
            f"{list(first)} and {list(second)} of {episodes} cannot be compared",
            where="successes",
            cure="Give both arms' counts for the same two seeds or more.",
        )
    counts = counts.astype(np.int64)  # truth values and unsigned ones have no differences
    rates = counts / episodes
    apart = (counts[1] - counts[0]) / episodes
    better, worse = int((apart > 0).sum()), int((apart < 0).sum())
    sign = [stats.binomtest(better, max(1, better + worse), alternative=side).pvalue for side in _SIDES]
    permuted = [
        stats.permutation_test(
            (counts[1], counts[0]),  # whole numbers: of rates, sums that are equal would differ by rounding
            lambda one, other, axis: (one - other).sum(axis=axis),
            permutation_type="samples",
            n_resamples=2**_EXACT_UP_TO,
            alternative=side,
            rng=np.random.default_rng(seed),
        ).pvalue
        for side in _SIDES
    ]
    return PairedComparison(
        first=_arm(counts[0], episodes),
        second=_arm(counts[1], episodes),
        difference=float(apart.mean()),
        interval=student_interval(apart),
        sign_greater=float(sign[0]) if better + worse else 1.0,
        sign_two_sided=float(sign[1]) if better + worse else 1.0,
        permutation_greater=float(permuted[0]),
        permutation_two_sided=float(permuted[1]),
        bootstrapped=_bootstrapped(rates, episodes, np.random.default_rng(seed)),
    )


def lines(compared: PairedComparison, names: tuple[str, str]) -> list[str]:
    """The comparison for people, in percent, with what so few pairs cannot show."""
    told = []
    for name, arm in zip(names, (compared.first, compared.second), strict=True):
        rate = f"{100 * arm.mean:.1f} ± {100 * arm.std:.1f} %"
        of_all = f"{sum(arm.successes)}/{compared.pairs * arm.episodes}"
        told.append(
            f"{name}: {rate}, mean ± sample standard deviation of {compared.pairs} seeds; "
            f"pooled {of_all} {_percent(arm.pooled)}, descriptive"
        )
    told.append(
        f"difference: {100 * compared.difference:.1f} points, t interval {_percent(compared.interval)}, "
        f"hierarchical bootstrap {_percent(compared.bootstrapped)}"
    )
    for test in ("sign", "permutation"):
        greater, two_sided = (getattr(compared, f"{test}_{side}") for side in ("greater", "two_sided"))
        told.append(f"{test} test: p = {greater:.3g} one-sided, {two_sided:.3g} two-sided")
    if compared.least_two_sided_p > 1.0 - CONFIDENCE:
        told.append(
            f"With {compared.pairs} pairs a two-sided p < 0.05 is impossible: none is below "
            f"{compared.least_two_sided_p:.4g}."
        )
    return told


def _percent(interval: Interval) -> str:
    return f"[{100 * interval[0]:.1f}, {100 * interval[1]:.1f}]"


def _arm(counts: np.ndarray, episodes: int) -> Arm:
    from scipy import stats

    rates = counts / episodes
    pooled = stats.binomtest(int(counts.sum()), episodes * len(counts)).proportion_ci(CONFIDENCE, "exact")
    return Arm(
        tuple(map(int, counts)), episodes, float(rates.mean()), float(rates.std(ddof=1)), (pooled.low, pooled.high)
    )


def _bootstrapped(rates: np.ndarray, episodes: int, rng: np.random.Generator) -> Interval:
    """Pairs are drawn with replacement, and in each drawn pair both arms' episodes."""
    drawn = rng.integers(rates.shape[1], size=(_BOOTSTRAPS, rates.shape[1]))
    again = rng.binomial(episodes, rates[:, drawn]) / episodes
    low, high = np.percentile((again[1] - again[0]).mean(axis=1), [50 - 50 * CONFIDENCE, 50 + 50 * CONFIDENCE])
    return float(low), float(high)

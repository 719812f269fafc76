"""Statistics of few values: intervals of confidence of independent means, medians of what counts unequally."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

CONFIDENCE = 0.95

Interval = tuple[float, float]


def student_interval(values: Sequence[float] | np.ndarray) -> Interval:
    """Student's interval of the mean of ``values`` (n,), two at least, independent of each other."""
    from scipy import stats

    found = np.asarray(values, np.float64)
    reach = stats.t.ppf(0.5 + CONFIDENCE / 2.0, len(found) - 1) * found.std(ddof=1) / np.sqrt(len(found))
    return float(found.mean() - reach), float(found.mean() + reach)


def weighted_median(values: np.ndarray, weights: np.ndarray) -> float:
    """The weighted median of (n,)."""
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order], dtype=np.float64)
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])

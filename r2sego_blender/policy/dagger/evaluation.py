"""Success of episodes, with its interval and the kinds of failure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest

from .episodes import Outcome


@dataclass(frozen=True)
class Evaluation:
    """``successes`` of ``episodes``, the rate's exact 95 % interval (Clopper-Pearson), failures and mean assist.

    ``failures`` has the number of each kind, the most frequent first; ``mean_assist_n`` is over the episodes.
    """

    successes: int
    episodes: int
    low: float
    high: float
    failures: dict[str, int]
    mean_assist_n: float

    @property
    def rate(self) -> float:
        """Share of successes."""
        return self.successes / self.episodes

    @staticmethod
    def of(outcomes: Iterable[Outcome]) -> Evaluation:
        """Counted from outcomes, of which there is at least one."""
        found = list(outcomes)
        failures = Counter(one.failure for one in found if one.failure)
        successes = len(found) - failures.total()
        interval = binomtest(successes, len(found)).proportion_ci(0.95, "exact")
        assist_n = float(np.mean([one.mean_assist_n for one in found]))
        kinds = dict(failures.most_common())
        return Evaluation(successes, len(found), float(interval.low), float(interval.high), kinds, assist_n)

    def __str__(self) -> str:
        kinds = ", ".join(f"{kind} {count}" for kind, count in self.failures.items()) or "none"
        share = f"{100.0 * self.rate:.0f} % [{100.0 * self.low:.0f}, {100.0 * self.high:.0f}]"
        return f"{self.successes}/{self.episodes}, {share}; failures: {kinds}; mean assist {self.mean_assist_n:.1f} N"

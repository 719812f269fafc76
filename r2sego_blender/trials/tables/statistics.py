"""Success rates over policies, exact: mean and sample standard deviation, and differences of pairs.

The independently trained policy is the replicate, not a single trial (Sec. "Real-Robot Sitting Validation"):
trials of one policy are pooled into its rate before anything is averaged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import ROUND_HALF_UP, Decimal, localcontext
from fractions import Fraction


@dataclass(frozen=True)
class Spread:
    """The ``mean`` of ``count`` policies' rates and their sample ``variance``, None of a single one."""

    count: int
    mean: Fraction
    variance: Fraction | None

    @staticmethod
    def of(rates: Sequence[Fraction]) -> Spread | None:
        """None without any."""
        if not rates:
            return None
        mean = sum(rates, Fraction(0)) / len(rates)
        squares = sum(((rate - mean) ** 2 for rate in rates), Fraction(0))
        return Spread(len(rates), mean, squares / (len(rates) - 1) if len(rates) > 1 else None)

    @property
    def texts(self) -> tuple[str, str]:
        """Mean and standard deviation in per cent with one decimal, half rounded up; "" of a single one."""
        return percent(self.mean), "" if self.variance is None else _percent_root(self.variance)


@dataclass(frozen=True)
class Difference:
    """Rates of one condition minus those of another, pair by pair; ``higher`` and ``lower`` count their signs."""

    spread: Spread
    higher: int
    lower: int

    @staticmethod
    def of(rates: Sequence[Fraction], others: Sequence[Fraction]) -> Difference | None:
        """Of rates that are paired by their places; None without any."""
        differences = [rate - other for rate, other in zip(rates, others, strict=True)]
        spread = Spread.of(differences)
        if spread is None:
            return None
        return Difference(spread, sum(one > 0 for one in differences), sum(one < 0 for one in differences))


def percent(share: Fraction) -> str:
    """A share in per cent with one decimal, half rounded up (away from 0)."""
    with localcontext() as context:
        context.prec = 60
        return _one_decimal(100 * Decimal(share.numerator) / Decimal(share.denominator))


def _percent_root(variance: Fraction) -> str:
    with localcontext() as context:
        context.prec = 60
        return _one_decimal(100 * (Decimal(variance.numerator) / Decimal(variance.denominator)).sqrt())


def _one_decimal(value: Decimal) -> str:
    return str(value.quantize(Decimal("0.1"), ROUND_HALF_UP) + 0)

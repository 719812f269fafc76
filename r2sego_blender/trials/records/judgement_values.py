"""A judgement as JSON values, as the index and each record hold it. Standard library alone."""

from __future__ import annotations

import math
from typing import Any

from ..outcome import Failure, Judgement, Outcome, Unusable

_KINDS: dict[str, Failure | Unusable] = {kind.name: kind for kinds in (Failure, Unusable) for kind in kinds}
_LONGEST, _MOST = 2000, 100


def judgement_values(judgement: Judgement) -> dict[str, Any]:
    """JSON values of a judgement; null for what nothing measured."""
    return {
        "outcome": judgement.outcome.name,
        "reasons": [[kind.name, text[:_LONGEST]] for kind, text in judgement.reasons[:_MOST]],
        "support_s": _or_null(judgement.support_s),
        "highest_tether_n": _or_null(judgement.highest_tether_n),
        "manual": judgement.manual[:_LONGEST],
    }


def judgement_of(values: Any) -> Judgement:
    """The judgement of ``judgement_values``. Raises ValueError for anything else."""
    try:
        reasons, manual = values["reasons"], values["manual"]
        if not isinstance(reasons, list) or len(reasons) > _MOST or not isinstance(manual, str):
            raise ValueError("its reasons are no list")
        return Judgement(
            outcome=Outcome[values["outcome"]],
            reasons=tuple((_KINDS[kind], str(text)[:_LONGEST]) for kind, text in reasons),
            support_s=_number(values["support_s"]),
            highest_tether_n=_number(values["highest_tether_n"]),
            manual=manual[:_LONGEST],
        )
    except (LookupError, TypeError, AttributeError) as error:
        raise ValueError(f"this is no judgement: {error}") from error


def _or_null(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)

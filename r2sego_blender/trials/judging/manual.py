"""A person's judgement in place of the sensors', recorded as one."""

from __future__ import annotations

import dataclasses

from ...core.errors import TrialError
from ..outcome import Failure, Judgement, Outcome, Unusable

_LONGEST_NAME, _LONGEST = 100, 1000


def manual_judgement(sensors: Judgement, outcome: str, by: str, why: str) -> Judgement:
    """The judgement of the person ``by``, who says ``why``, in place of one by the sensors or of another person.

    The judgement's ``manual`` has both. ``outcome`` is an ``Outcome``'s value. A recording that was unusable stays so: nobody makes it count. Raises
    TrialError for that, and without a name, a reason or an outcome.
    """
    by, why = by.strip()[:_LONGEST_NAME], why.strip()[:_LONGEST]
    if outcome not in [one.value for one in Outcome]:
        raise _refused(f"'{outcome}' is no outcome", "Give success, failure or unusable.")
    if not by or not why:
        raise _refused("a judgement by hand has a name and a reason", "Say whose it is, and why.")
    judged = Outcome(outcome)
    if sensors.outcome is Outcome.UNUSABLE and judged is not Outcome.UNUSABLE:
        raise _refused("an unusable recording does not count, whoever judges it", "Run the trial again.")
    reasons: tuple[tuple[Failure | Unusable, str], ...] = ()
    if judged is Outcome.FAILURE:
        reasons = ((Failure.OBSERVED, why),)
    elif judged is Outcome.UNUSABLE:
        reasons = ((Unusable.ABORTED, why), *sensors.reasons)
    return dataclasses.replace(sensors, outcome=judged, reasons=reasons, manual=f"{by}: {why}")


def _refused(what: str, cure: str) -> TrialError:
    return TrialError(what, where="judgement by hand", cure=cure)

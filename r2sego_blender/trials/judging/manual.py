"""A person's judgement in place of the sensors': whose it is stands in it, and it saves no unusable recording."""

from __future__ import annotations

from ...core.errors import TrialError
from ...core.printable import printable
from ..outcome import Failure, Judgement, Outcome, Unusable

Reasons = tuple[tuple[Failure | Unusable, str], ...]

_MOST_BY, _MOST_TEXT = 100, 500


def manual_judgement(judgement: Judgement, outcome: str, by: str, text: str = "") -> Judgement:
    """What ``by`` says a trial ended in, "success", "failure" or "unusable", in place of ``judgement``.

    What was measured stays. Of a failure the sensors' reasons stay too, else it is what was seen; why a recording is
    unusable stays whatever is said. Raises TrialError: nobody says it, it is none of these words,
    or a success of an unusable recording.
    """
    where = "manual judgement"
    if not by.strip():
        raise TrialError("it is nobody's", where=where, cure="Say who judges.")
    said = next((one for one in Outcome if one.value == outcome), None)
    if said is None:
        cure = f"Say one of: {', '.join(one.value for one in Outcome)}."
        raise TrialError(f"'{outcome}' is nothing a trial ends in", where=where, cure=cure)
    unusable: Reasons = tuple(reason for reason in judgement.reasons if isinstance(reason[0], Unusable))
    failures: Reasons = tuple(reason for reason in judgement.reasons if isinstance(reason[0], Failure))
    if said is Outcome.SUCCESS and unusable:
        cure = "Run the trial again: what was recorded cannot show it."
        raise TrialError("an unusable recording is no success, whoever says so", where=where, cure=cure)
    words = printable(text.strip(), _MOST_TEXT)
    reasons: Reasons = ()
    if said is Outcome.FAILURE:
        reasons = (*(failures or ((Failure.OBSERVED, words),)), *unusable)
    elif said is Outcome.UNUSABLE:
        reasons = (*(unusable or ((Unusable.ABORTED, words),)), *failures)
    name = printable(by.strip(), _MOST_BY)
    who = f"{name}: {words}" if words else name
    return Judgement(said, reasons, judgement.support_s, judgement.highest_tether_n, who)

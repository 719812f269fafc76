"""The table of a paired experiment, for people: the seeds first, then what may be said of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from ..dagger.episodes import Outcome
from ..dagger.evaluation import Evaluation
from ..statistics import compare_pairs, lines
from .experiment import Outcomes


def markdown(found: Mapping[str, Sequence[Outcomes]], psnr: Mapping[str, float]) -> Iterator[str]:
    """Lines of the outcomes of two arms, seed by seed, and the PSNR in dB of their assets where it is known."""
    arms = list(found)
    for test in found[arms[0]][0]:
        counts = {arm: [_successes(policy[test]) for policy in found[arm]] for arm in arms}
        episodes = len(found[arms[0]][0][test])
        yield f"### Test: {test}, {episodes} episodes a policy"
        yield ""
        yield f"| seed | {' | '.join(arms)} |"
        yield f"| --- | {' | '.join('---' for _ in arms)} |"
        for seed, row in enumerate(zip(*counts.values(), strict=True)):
            yield f"| {seed} | {' | '.join(map(str, row))} |"
        yield ""
        for arm in arms:
            yield f"- {arm}{_psnr(psnr.get(arm))}: {_failures([one for policy in found[arm] for one in policy[test]])}"
        if len(found[arms[0]]) > 1:
            compared = compare_pairs(counts[arms[0]], counts[arms[1]], episodes)
            yield from (f"- {line}" for line in lines(compared, (arms[0], arms[1])))
        yield ""
    yield "Driven by the embedded assisted controller: the helping force on the base is the mean assist."


def _successes(outcomes: Sequence[Outcome]) -> int:
    return sum(not outcome.failure for outcome in outcomes)


def _failures(outcomes: Sequence[Outcome]) -> str:
    evaluation = Evaluation.of(outcomes)
    kinds = ", ".join(f"{kind} {count}" for kind, count in evaluation.failures.items()) or "none"
    return f"failures: {kinds}; mean assist {evaluation.mean_assist_n:.1f} N"


def _psnr(psnr: float | None) -> str:
    return "" if psnr is None or not math.isfinite(psnr) else f" ({psnr:.2f} dB at the frozen views)"

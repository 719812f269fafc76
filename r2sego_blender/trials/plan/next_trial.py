"""Which trial of a plan comes next, and whether it is tethered: what the trials before it ended in decides."""

from __future__ import annotations

from collections.abc import Sequence

from ..outcome import Outcome
from .trial_plan import PlannedTrial, TrialPlan

Ended = tuple[int, bool, Outcome]
"""A trial's index, whether it was tethered, and what it ended in; of all that were run, in their order."""


def next_trial(plan: TrialPlan, ended: Sequence[Ended]) -> PlannedTrial | None:
    """The next trial by the plan's order and its rule for reruns; None when each has a usable recording."""
    usable = {index for index, _, outcome in ended if outcome is not Outcome.UNUSABLE}
    tried = {index for index, _, _ in ended}
    left = [trial for trial in plan.trials if trial.index not in usable]
    if plan.rules.rerun == "at_end":
        left.sort(key=lambda trial: trial.index in tried)
    return left[0] if left else None


def is_tethered(trial: PlannedTrial, plan: TrialPlan, ended: Sequence[Ended]) -> bool:
    """Whether the tether stays on: until a tethered trial of the same policy succeeded, or always."""
    if trial.tether == "always":
        return True
    policy = (trial.condition, trial.policy_seed)
    return not any(
        tethered and outcome is Outcome.SUCCESS
        for index, tethered, outcome in ended
        if (plan.trials[index].condition, plan.trials[index].policy_seed) == policy
    )

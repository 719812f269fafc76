"""Successes of each policy, from a study's plan and the index of its records."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ...core.errors import TrialError
from ...core.formatting import counted
from ..outcome import Failure, Outcome, Unusable
from ..plan.study import state_of
from ..plan.trial_plan import PlannedPolicy, PlannedTrial, TrialPlan
from ..records.index import Entry, RecordIndex


@dataclass(frozen=True)
class PolicyCount:
    """What one policy did: ``successes`` of so many ``trials`` with a usable recording, of ``planned`` ones."""

    policy: PlannedPolicy
    successes: int
    trials: int
    planned: int


@dataclass(frozen=True)
class Results:
    """A plan with its records, which all are of it."""

    plan: TrialPlan
    entries: tuple[Entry, ...]

    @staticmethod
    def of(study_folder: str | Path) -> Results:
        """The results of a study so far.

        Raises TrialError: a record is of another plan, or counts are to stay hidden from a blinded operator.
        """
        study = Path(study_folder)
        plan, index = TrialPlan.load(study), RecordIndex(study)
        results = Results(plan, tuple(index.entries()))
        for entry in results.entries:
            if entry.plan != plan.digest or entry.trial >= len(plan.trials):
                raise TrialError(
                    f"record {entry.number} is of another plan", where=index.file, cure="Put back the plan as it was."
                )
        if plan.blinded and not results.complete and not state_of(study).ended:
            cure = "Run the trials that are left, or end the study with a reason: r2sego trials end."
            raise TrialError("this study is blinded until its last trial", where=study, cure=cure)
        return results

    @property
    def usable(self) -> dict[int, Entry]:
        """The record that counts of each trial, by its index: the first with a usable recording."""
        found: dict[int, Entry] = {}
        for entry in self.entries:
            if entry.judgement.outcome is not Outcome.UNUSABLE:
                found.setdefault(entry.trial, entry)
        return found

    @property
    def complete(self) -> bool:
        """Whether every trial has a usable recording."""
        return len(self.usable) == len(self.plan.trials)

    def counts(self) -> tuple[PolicyCount, ...]:
        """Of each policy, in the plan's order of them."""
        usable = self.usable
        found = []
        for policy in self.plan.policies:
            trials = [trial for trial in self.plan.trials if _of(trial) == (policy.condition, policy.seed)]
            outcomes = [usable[trial.index].judgement.outcome for trial in trials if trial.index in usable]
            found.append(PolicyCount(policy, outcomes.count(Outcome.SUCCESS), len(outcomes), len(trials)))
        return tuple(found)

    def kinds(self) -> dict[str, Counter[Failure | Unusable]]:
        """By condition, why trials failed and why recordings were unusable: each by its first reason."""
        usable = self.usable
        kinds: dict[str, Counter[Failure | Unusable]] = {condition: Counter() for condition in self.plan.conditions}
        for entry in self.entries:
            if entry.judgement.reasons and (
                entry.judgement.outcome is Outcome.UNUSABLE or entry is usable.get(entry.trial)
            ):
                kinds[self.plan.trials[entry.trial].condition][entry.judgement.reasons[0][0]] += 1
        return kinds

    def failed_unusable(self) -> Counter[str]:
        """By condition, unusable recordings in which a failure was seen: their reruns favour the policy."""
        return Counter(
            self.plan.trials[entry.trial].condition
            for entry in self.entries
            if entry.judgement.outcome is Outcome.UNUSABLE and _saw_failure(entry.judgement.reasons)
        )

    @property
    def simulated(self) -> bool:
        """Whether devices were simulated, and so no robot was tried."""
        return any(entry.simulated for entry in self.entries)

    def about(self) -> tuple[str, ...]:
        """What is to be known of the records beside the counts, a sentence each."""
        told = ["Simulated devices: no robot was tried."] if self.simulated else []
        if by_hand := sum(bool(entry.judgement.manual) for entry in self.usable.values()):
            told.append(f"Judged by a person in place of the sensors: {counted(by_hand, 'trial')}.")
        unusable = Counter(
            self.plan.trials[entry.trial].condition
            for entry in self.entries
            if entry.judgement.outcome is Outcome.UNUSABLE
        )
        seen = self.failed_unusable()
        for condition, count in unusable.items():
            told.append(
                f"{condition}: {counted(count, 'unusable recording')}, which count neither way; "
                f"a failure was seen in {seen[condition]}."
            )
        return tuple(told)


def _saw_failure(reasons: Sequence[tuple[Failure | Unusable, str]]) -> bool:
    """Load on the tether, a stop or an intervention; that the chair bore nothing may be the recording's fault."""
    return any(kind in (Failure.TETHER, Failure.INTERVENTION, Failure.EMERGENCY_STOP) for kind, _ in reasons)


def _of(trial: PlannedTrial) -> tuple[str, int]:
    return trial.condition, trial.policy_seed

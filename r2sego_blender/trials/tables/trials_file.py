"""Every record of a study as a line of CSV, with units in the names; and kinds of failure."""

from __future__ import annotations

import math

from ..outcome import Failure, Outcome, Unusable
from .counts import Results
from .success_table import csv_text

_COLUMNS = (
    "record",
    "trial",
    "counts",
    "condition",
    "policy_seed",
    "policy_sha256",
    "label",
    "repetition",
    "tethered",
    "began_utc",
    "simulated",
    "outcome",
    "reasons",
    "sensors_outcome",
    "judged_by",
    "support_s",
    "highest_tether_n",
    "chair",
    "chair_x_m",
    "chair_y_m",
    "chair_heading_deg",
    "robot_x_m",
    "robot_y_m",
    "robot_heading_deg",
    "plan_sha256",
    "record_sha256",
)


def trials_csv(results: Results) -> str:
    """A line a record, unusable ones too; ``counts`` says whether it is in the table. Trials count from 1."""
    usable = results.usable
    rows: list[list[object]] = [list(_COLUMNS)]
    for entry in results.entries:
        trial, judgement = results.plan.trials[entry.trial], entry.judgement
        chair, robot = trial.chair_pose, trial.robot_pose
        rows.append(
            [
                entry.number,
                trial.number,
                _word(usable.get(entry.trial) is entry),
                trial.condition,
                trial.policy_seed,
                trial.policy_sha256,
                trial.label,
                trial.repetition + 1,
                _word(entry.tethered),
                entry.began,
                _word(entry.simulated),
                judgement.outcome.value,
                "; ".join(f"{kind.value}: {text}" if text else kind.value for kind, text in judgement.reasons),
                entry.sensors.outcome.value if entry.sensors else "",
                judgement.manual or "sensors",
                _number(judgement.support_s),
                _number(judgement.highest_tether_n),
                trial.chair,
                *(chair.x_m, chair.y_m, chair.heading_deg, robot.x_m, robot.y_m, robot.heading_deg),
                results.plan.digest,
                entry.sha256,
            ]
        )
    return csv_text(rows)


def kinds_csv(results: Results) -> str:
    """How often each condition failed for each reason, and how often its recordings were unusable."""
    kinds, seen = results.kinds(), results.failed_unusable()
    conditions = results.plan.conditions
    rows: list[list[object]] = [["outcome", "kind", *conditions]]
    for outcome, every in ((Outcome.FAILURE, Failure), (Outcome.UNUSABLE, Unusable)):
        for kind in every:
            numbers = [kinds[condition][kind] for condition in conditions]
            if any(numbers):
                rows.append([outcome.value, kind.value, *numbers])
    if seen:
        rows.append([Outcome.UNUSABLE.value, "a failure was seen", *(seen[condition] for condition in conditions)])
    return csv_text(rows)


def _word(is_so: bool) -> str:
    return "yes" if is_so else "no"


def _number(value: float) -> float | str:
    return float(f"{value:.6g}") if math.isfinite(value) else ""

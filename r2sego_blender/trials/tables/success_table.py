"""The paper's Table 3: success in simulation and on the robot, mean and standard deviation over policies."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from ...core.formatting import latex_text, markdown_text
from .counts import PolicyCount
from .statistics import Difference, Spread


@dataclass(frozen=True)
class Row:
    """One condition; ``pooled`` are successes and trials of all its policies, which only describe."""

    condition: str
    simulated: Spread | None
    real: Spread | None
    pooled: tuple[int, int]
    by_seed: tuple[tuple[int, int, int], ...]
    """Seed, successes and usable trials of each policy."""


@dataclass(frozen=True)
class SuccessTable:
    """The rows by condition, and the differences by seed of each condition to the first one.

    ``complete`` is whether every planned trial has a usable recording; ``about`` is what else is to be known of the
    records, a sentence each.
    """

    rows: tuple[Row, ...]
    differences: tuple[tuple[str, Difference], ...]
    complete: bool
    about: tuple[str, ...] = ()

    @staticmethod
    def of(counts: Sequence[PolicyCount], about: tuple[str, ...] = ()) -> SuccessTable:
        """The table of policies' counts; a policy without a usable trial is in no mean."""
        conditions = list(dict.fromkeys(count.policy.condition for count in counts))
        rates = {
            (one.policy.condition, one.policy.seed): Fraction(one.successes, one.trials) for one in counts if one.trials
        }
        differences = []
        for condition in conditions[1:]:
            seeds = [seed for one, seed in rates if one == condition and (conditions[0], seed) in rates]
            pairs = [(rates[condition, seed], rates[conditions[0], seed]) for seed in seeds]
            if difference := Difference.of([one for one, _ in pairs], [other for _, other in pairs]):
                differences.append((f"{condition} - {conditions[0]}", difference))
        return SuccessTable(
            tuple(
                _row(condition, [one for one in counts if one.policy.condition == condition])
                for condition in conditions
            ),
            tuple(differences),
            all(one.trials == one.planned for one in counts),
            about,
        )

    def markdown(self) -> str:
        """For people: the table, counts by seed, differences and what they are of."""
        lines = ["| Training scene | Sim (%, mean ± std) | Real (%, mean ± std) |", "| --- | ---: | ---: |"]
        lines += [
            f"| {markdown_text(row.condition)} | {_plain(row.simulated)} | {_plain(row.real)} |" for row in self.rows
        ]
        lines += ["", *map(markdown_text, self.notes())]
        return "\n".join(lines) + "\n"

    def notes(self) -> list[str]:
        """What stands below the table, a sentence each."""
        notes = ["Mean and sample standard deviation over independently trained policies."]
        for row in self.rows:
            seeds = ", ".join(f"{successes}/{trials}" for _, successes, trials in row.by_seed)
            notes.append(
                f"{row.condition}: by seed {seeds}; pooled {row.pooled[0]}/{row.pooled[1]}, which only describes."
            )
        for name, one in self.differences:
            notes.append(
                f"{name}: {_plain(one.spread)} percentage points over pairs of one seed; "
                f"higher in {one.higher}, lower in {one.lower} of {one.spread.count}."
            )
        if not self.complete:
            notes.append("Incomplete: trials are left without a usable recording.")
        return [*notes, *self.about]

    def latex(self) -> str:
        """The tabular of the paper; the condition with the highest mean on the robot is bold."""
        best = max((row.real.mean for row in self.rows if row.real), default=None)
        lines = [
            *(f"% {latex_text(note)}" for note in self.notes()),
            r"\begin{tabular}{@{}lcc@{}}",
            r"  \toprule",
            r"  Training scene & Sim (\%, mean $\pm$ std) & Real (\%, mean $\pm$ std) \\",
            r"  \midrule",
        ]
        for row in self.rows:
            cells = [latex_text(row.condition), _maths(row.simulated), _maths(row.real)]
            if row.real and row.real.mean == best:
                cells = [rf"\textbf{{{cell}}}" for cell in cells]
            lines.append(rf"  {' & '.join(cells)} \\")
        return "\n".join([*lines, r"  \bottomrule", r"\end{tabular}"]) + "\n"

    def csv(self) -> str:
        """A line a condition, per cent; "" where nothing was measured."""
        head = ("condition", "policies", "sim_mean_percent", "sim_std_percent", "real_mean_percent", "real_std_percent")
        rows = [
            [row.condition, len(row.by_seed), *_texts(row.simulated), *_texts(row.real), *row.pooled]
            for row in self.rows
        ]
        return csv_text([[*head, "pooled_successes", "pooled_trials"], *rows])


def seeds_csv(counts: Sequence[PolicyCount]) -> str:
    """A line a policy: what it did in its simulator and on the robot."""
    head = ["condition", "seed", "sim_successes", "sim_episodes", "real_successes", "real_trials", "real_planned"]
    rows = [
        [
            one.policy.condition,
            one.policy.seed,
            *(
                ["", ""]
                if one.policy.simulated_successes is None
                else [one.policy.simulated_successes, one.policy.simulated_episodes]
            ),
            one.successes,
            one.trials,
            one.planned,
        ]
        for one in counts
    ]
    return csv_text([head, *rows])


def csv_text(rows: Sequence[Sequence[object]]) -> str:
    """Rows as CSV; a text that a spreadsheet would take for a formula is quoted for it."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([[_no_formula(cell) for cell in row] for row in rows])
    return text.getvalue()


def _no_formula(cell: object) -> object:
    return f"'{cell}" if isinstance(cell, str) and cell[:1] in ("=", "+", "-", "@") else cell


def _row(condition: str, counts: Sequence[PolicyCount]) -> Row:
    simulated = [
        Fraction(one.policy.simulated_successes, one.policy.simulated_episodes)
        for one in counts
        if one.policy.simulated_successes is not None
    ]
    return Row(
        condition,
        Spread.of(simulated),
        Spread.of([Fraction(one.successes, one.trials) for one in counts if one.trials]),
        (sum(one.successes for one in counts), sum(one.trials for one in counts)),
        tuple((one.policy.seed, one.successes, one.trials) for one in counts),
    )


def _texts(spread: Spread | None) -> tuple[str, str]:
    return spread.texts if spread else ("", "")


def _plain(spread: Spread | None) -> str:
    mean, std = _texts(spread)
    return f"{mean} ± {std}" if std else mean or "-"


def _maths(spread: Spread | None) -> str:
    mean, std = _texts(spread)
    return rf"{mean} $\pm$ {std}" if std else mean or "--"

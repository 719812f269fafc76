"""``r2sego trials plan``, ``page`` and ``end``: a plan drawn and frozen, printed, and ended with a reason."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ...core.formatting import counted
from ..options import ANY_PATH, FOLDER, NEW_FILE, Output, output_options

_STUDY = click.argument("study", type=FOLDER)


@click.command("plan")
@click.argument("declaration", type=ANY_PATH)
@click.option("--to", "study", type=FOLDER, help="The study's folder.  [default: DECLARATION's name with .trials]")
@output_options("--json", "--json-progress")
def plan_trials(declaration: Path, study: Path | None, output: Output) -> None:
    """Draw the plan of the study that DECLARATION, a TOML file, declares, and freeze it.

    docs/trials.md has its fields. A plan may be drawn anew until its first trial begins; from then on it cannot be
    changed, only ended.
    """
    from ...trials.plan.study import freeze_plan

    plan, folder = freeze_plan(declaration, study)
    told = {
        "study": str(folder),
        "sha256": plan.digest,
        "trials": len(plan.trials),
        "conditions": [*plan.conditions],
        "seeds": [*plan.seeds],
    }
    output.show(told, _planned)


@click.command("page")
@_STUDY
@click.option("--to", "file", type=NEW_FILE, help="The page.  [default: plan.html in STUDY]")
@output_options("--json-progress")
def print_page(study: Path, file: Path | None, output: Output) -> None:
    """Write STUDY's plan as one HTML page to print: rules, and a floor plan with the poses of each trial."""
    from ...core.atomic_files import write_whole
    from ...trials.plan.page import plan_page
    from ...trials.plan.trial_plan import PAGE, TrialPlan

    page = file or study / PAGE
    write_whole(page, plan_page(TrialPlan.load(study)))
    output.tell(page=str(page))


@click.command("end")
@_STUDY
@click.option("--reason", required=True, metavar="TEXT", help="Why; it stands in the study for good.")
@output_options("--json-progress")
def end_trials(study: Path, reason: str, output: Output) -> None:
    """End STUDY for good: its trials are run no more; its records and tables stay."""
    from ...trials.plan.study import end_study

    end_study(study, reason)
    output.tell(ended=str(study))


def _planned(told: dict[str, Any]) -> list[str]:
    of = f"{', '.join(told['conditions'])} with {counted(len(told['seeds']), 'seed')}"
    return [f"study: {told['study']}", f"plan: {told['sha256']}", f"{counted(told['trials'], 'trial')} of {of}"]


COMMANDS = (plan_trials, print_page, end_trials)

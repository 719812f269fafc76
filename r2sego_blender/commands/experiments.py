"""``r2sego experiment``: scenes, capture counts, arms and seeds, run and put into tables."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .options import ANY_PATH, FOLDER, Output, output_options

if TYPE_CHECKING:
    from ..experiments.plan import Plan


def plan_options(command: Callable) -> Callable:
    """How an experiment is run."""
    options = (
        click.option("--out", "folder", required=True, type=FOLDER, help="Folder of the experiment, made if missing."),
        click.option(
            "--processes",
            type=click.IntRange(0, 4096),
            default=0,
            metavar="N",
            help="Cells at once; by default as many as cores and free memory allow.",
        ),
        click.option(
            "--ray",
            "cluster",
            metavar="auto|HOST:PORT",
            help="On a Ray cluster in place of --processes; auto: the one of this machine, else one of its own.",
        ),
        click.option(
            "--dry-run", is_flag=True, help="Say which cells there are and which are done; runs and writes nothing."
        ),
        output_options("--json", "--json-progress"),
    )
    for option in reversed(options):
        command = option(command)
    return command


@click.command()
@click.argument("plan", type=ANY_PATH)
@plan_options
def experiment(plan: Path, folder: Path, processes: int, cluster: str | None, dry_run: bool, output: Output) -> None:
    """Run every cell of the file PLAN that is not done yet, and write metrics.json, tables and figures.

    A cell is a scene with a count of captures, a preset and a seed: a bundle that is refined and evaluated. Started
    again, it goes on where it stopped. Ends with status 1 where a cell failed.
    """
    from ..experiments.plan import Plan

    run_plan(Plan.load(plan), folder, processes, cluster, dry_run, output)


def run_plan(plan: Plan, folder: Path, processes: int, cluster: str | None, dry_run: bool, output: Output) -> None:
    """Run a plan's cells, or say which there are."""
    from ..experiments.experiment import Experiment, run_experiment
    from ..experiments.ray_runner import ray_runner

    if cluster is not None and processes:
        raise click.UsageError("Give one of --processes and --ray.")
    if dry_run:
        found = Experiment.of(plan, folder, output.progress, write=False)
        output.show(_told(found, {}), _lines)
        return
    opened = None if cluster is None else ray_runner(cluster, output.progress.message)
    found, failures = run_experiment(plan, folder, processes, output.progress, cluster=opened)
    output.show(_told(found, failures), _lines)
    sys.exit(1 if failures and not output.as_events else 0)


def _told(found: Any, failures: Any) -> dict[str, Any]:
    cells = [
        {"name": cell.name, "state": found.state(cell), "folder": str(cell.folder)}
        | ({"failure": failures[cell.folder]} if cell.folder in failures else {})
        for cell in found.cells
    ]
    return {"folder": str(found.folder), "cells": cells}


def _lines(told: dict[str, Any]) -> list[str]:
    from ..experiments.gathering import MARKDOWN

    lines = [
        f"{cell['state']:<6} {cell['name']}" + f": {cell.get('failure', '')}".rstrip(": ") for cell in told["cells"]
    ]
    done = sum(cell["state"] == "done" for cell in told["cells"])
    tables = Path(told["folder"], MARKDOWN)
    return [*lines, f"{done} of {len(lines)} cells done" + (f"; tables: {tables}" if tables.is_file() else "")]


COMMANDS = (experiment,)

"""``r2sego experiment``: scenes, capture counts, arms and seeds, run and put into tables."""

from __future__ import annotations

import contextlib
import functools
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .options import ANY_PATH, FOLDER, Output, names_of, output_options

if TYPE_CHECKING:
    from ..experiments.plan import Plan
    from ..experiments.prepared import DatasetChoice


@dataclass(frozen=True)
class RunOptions:
    """How an experiment is run: in which ``folder``, by what, and what is told where."""

    folder: Path
    processes: int
    cluster: str | None
    store: str | None
    dry_run: bool
    output: Output


def plan_options(command: Callable) -> Callable:
    """How an experiment is run, given as ``run``."""
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
            "--store",
            metavar="s3://BUCKET/PREFIX|file:///FOLDER",
            help="Storage that all machines reach, where they share no disk: cells take and leave everything there.",
        ),
        click.option(
            "--dry-run", is_flag=True, help="Say which cells there are and which are done; runs and writes nothing."
        ),
        output_options("--json", "--json-progress"),
    )

    @functools.wraps(command)
    def run(
        folder: Path,
        processes: int,
        cluster: str | None,
        store: str | None,
        dry_run: bool,
        output: Output,
        **given: Any,
    ) -> None:
        command(run=RunOptions(folder, processes, cluster, store, dry_run, output), **given)

    for option in reversed(options):
        run = option(run)
    return run


def dataset_options(command: Callable) -> Callable:
    """What of a data set is asked for, given as ``choice``; its folder is given as ``data``."""
    options = (
        click.option("--data", type=FOLDER, help="Folder of a data set; PLAN is its name then."),
        click.option("--scenes", default="", metavar="NAME,NAME", help="Of the data set's scenes these alone."),
        click.option(
            "--captures",
            type=click.IntRange(3, 10_000),
            metavar="N",
            help="Of the data set, captures a scene; by default as its protocol has them.",
        ),
        click.option("--preset", default="", help="Of the data set's cells.  [default: paper]"),
        click.option(
            "--seeds", type=click.IntRange(1, 1000), metavar="N", help="Of the data set's cells, so many.  [default: 5]"
        ),
        click.option("--sensor-depth", is_flag=True, help="Captures have what the data set's depth sensor measured."),
    )

    @functools.wraps(command)
    def run(
        scenes: str, captures: int | None, preset: str, seeds: int | None, sensor_depth: bool, **given: Any
    ) -> None:
        from ..experiments.prepared import DatasetChoice

        choice = DatasetChoice(names_of(scenes), captures or 0, preset, seeds or 0, sensor_depth)
        command(choice=choice, **given)

    for option in reversed(options):
        run = option(run)
    return run


@click.command()
@click.argument("plan", type=ANY_PATH)
@dataset_options
@plan_options
def experiment(plan: Path, data: Path | None, choice: DatasetChoice, run: RunOptions) -> None:
    """Run every cell of the file PLAN that is not done yet, and write metrics.json, tables and figures.

    A cell is a scene with a count of captures, a preset and a seed: a bundle that is refined and evaluated. Started
    again, it goes on where it stopped. Ends with status 1 where a cell failed.

    With --data PLAN is the name of a data set, replica, 7scenes or scannetpp, whose scenes lie there.
    """
    from ..core.scratch import ScratchFolder
    from ..experiments.datasets.registry import DATASETS
    from ..experiments.plan import Plan
    from ..experiments.prepared import SCENES, DatasetChoice, dataset_plan

    if data is None:
        if str(plan) in DATASETS and not plan.exists():
            raise click.UsageError(f"Give the folder of {plan} with --data.")
        if choice != DatasetChoice():
            raise click.UsageError("Give --data, or take the options of data sets away.")
        run_plan(Plan.load(plan), run)
        return
    with ScratchFolder() if run.dry_run else contextlib.nullcontext(run.folder / SCENES) as place:
        run_plan(dataset_plan(str(plan), data, Path(place), choice, run.output.progress), run)


def run_plan(plan: Plan, run: RunOptions) -> None:
    """Run a plan's cells, or say which there are."""
    from ..experiments.experiment import Experiment, run_experiment
    from ..experiments.object_store import ObjectStore
    from ..experiments.ray_runner import ray_runner

    output = run.output
    if run.cluster is not None and run.processes:
        raise click.UsageError("Give one of --processes and --ray.")
    store = None if run.store is None else ObjectStore.at(run.store)
    if run.dry_run:
        found = Experiment.of(plan, run.folder, output.progress, write=False)
        output.show(_told(found, {}), _lines)
        return
    opened = None if run.cluster is None else ray_runner(run.cluster, output.progress.message)
    found, failures = run_experiment(plan, run.folder, run.processes, output.progress, cluster=opened, store=store)
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

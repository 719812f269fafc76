"""``r2sego experiment``: a plan of scenes, capture counts, arms, seeds and presets, run and put into tables."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from .options import ANY_PATH, FOLDER, Output, output_options


@click.command()
@click.argument("plan", type=ANY_PATH)
@click.option("--out", "folder", required=True, type=FOLDER, help="Folder of the experiment, made if missing.")
@click.option(
    "--processes",
    type=click.IntRange(0, 4096),
    default=0,
    metavar="N",
    help="Cells at once; by default as many as cores and free memory allow.",
)
@click.option("--dry-run", is_flag=True, help="Say which cells there are and which are done; runs and writes nothing.")
@output_options("--json", "--json-progress")
def experiment(plan: Path, folder: Path, processes: int, dry_run: bool, output: Output) -> None:
    """Run every cell of the file PLAN that is not done yet, and write metrics.json, tables and figures.

    A cell is a scene with a count of captures, a preset and a seed: a bundle that is refined and evaluated. Started
    again, it goes on where it stopped. Ends with status 1 where a cell failed.
    """
    from ..experiments.experiment import Experiment, run_experiment
    from ..experiments.plan import Plan

    declared = Plan.load(plan)
    if dry_run:
        found = Experiment.of(declared, folder, output.progress, write=False)
        output.show(_told(found, {}), _lines)
        return
    found, failures = run_experiment(declared, folder, processes, output.progress)
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
    return [*lines, f"{done} of {len(lines)} cells done; tables: {Path(told['folder'], MARKDOWN)}"]


COMMANDS = (experiment,)

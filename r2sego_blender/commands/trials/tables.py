"""``r2sego trials table``: what the trials of a study show."""

from __future__ import annotations

from pathlib import Path

import click

from ..options import FOLDER, Output, output_options


@click.command("table")
@click.argument("study", type=FOLDER)
@click.option("--to", "folder", type=FOLDER, help="Folder to write.  [default: tables in STUDY]")
@output_options("--json", "--json-progress")
def tables(study: Path, folder: Path | None, output: Output) -> None:
    """Count STUDY's trials: the paper's Table 3 and its figure, every trial with units, and kinds of failure.

    table3.md, .csv and .tex, figure.svg, policies.csv, trials.csv and failures.csv. Of a blinded study nothing is
    told before its last trial or its end.
    """
    from ...trials.tables.counts import Results
    from ...trials.tables.writing import TABLES, write_tables

    results = Results.of(study)
    table, files = write_tables(results, folder or study / TABLES)
    names = [str(file) for file in files]
    told = {
        "files": names,
        "complete": table.complete,
        "simulated": results.simulated,
        "pooled": {row.condition: [*row.pooled] for row in table.rows},
        "real_percent": {row.condition: row.real.texts if row.real else None for row in table.rows},
        "sim_percent": {row.condition: row.simulated.texts if row.simulated else None for row in table.rows},
    }
    output.show(told, lambda _: [table.markdown(), *names])


COMMANDS = (tables,)

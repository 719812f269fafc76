"""Writes a study's tables and figure into its folder."""

from __future__ import annotations

from pathlib import Path

from ...core.atomic_files import write_whole
from ...core.errors import TrialError
from .counts import Results
from .success_figure import success_figure
from .success_table import SuccessTable, seeds_csv
from .trials_file import kinds_csv, trials_csv

TABLES = "tables"
"""The folder in a study's."""


def write_tables(results: Results, folder: Path) -> tuple[SuccessTable, list[Path]]:
    """Write every table of a study's results into ``folder``; the paper's, and the files. Raises TrialError."""
    counts = results.counts()
    table = SuccessTable.of(counts, results.about())
    texts = {
        "table3.md": table.markdown(),
        "table3.csv": table.csv(),
        "table3.tex": table.latex(),
        "figure.svg": success_figure(counts),
        "policies.csv": seeds_csv(counts),
        "trials.csv": trials_csv(results),
        "failures.csv": kinds_csv(results),
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            write_whole(folder / name, text)
    except OSError as error:
        raise TrialError(
            f"the tables cannot be written: {error.strerror}", where=folder, cure="Name a folder you may write in."
        ) from error
    return table, [folder / name for name in texts]

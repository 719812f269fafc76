"""An experiment in its folder: what is to be done, what is done, and its tables. One process at a time runs it."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..core.errors import ExperimentError
from ..core.file_locks import try_lock
from ..core.formatting import counted
from ..core.progress import SILENT, Progress
from .cells import Cell, cells_of
from .equipment import equipment
from .gathering import gather
from .inputs import fixed_inputs
from .local_runner import LocalRunner
from .object_store import ObjectStore
from .plan import Plan
from .records import Record, final_record
from .running import PROGRAM, Outcome, RunCell, run_cell
from .scheduling import Expectations, Runner, Sparing, schedule
from .stored_cells import StoredCells, bring, put_scenes

LOCK = ".lock"

DONE, BEGUN, LEFT = "done", "begun", "left"
"""What a cell may be."""


@dataclass(frozen=True)
class Experiment:
    """The cells of a plan in a folder, and the records of those that are done, by their folders."""

    plan: Plan
    folder: Path
    cells: tuple[Cell, ...]
    records: Mapping[Path, Record]

    @staticmethod
    def of(plan: Plan, folder: Path, progress: Progress = SILENT, write: bool = True) -> Experiment:
        """What the folder holds of a plan; its inputs are fixed there, unless nothing may be written.

        Raises as ``fixed_inputs``. Records that are damaged, of what a cell was made of before, or without what can be
        scored now, do not count.
        """
        folder = folder.absolute()
        cells = cells_of(plan, fixed_inputs(plan, folder, write), folder)
        records = {}
        at_hand = {arms: equipment(arms) for arms in {cell.arms for cell in cells}}
        for cell in cells:
            try:
                record = final_record(cell.folder, cell.key, at_hand[cell.arms])
            except ExperimentError as error:
                progress.message(f"{error} It is made again.", "warning")
                continue
            if record is not None:
                records[cell.folder] = record
        return Experiment(plan, folder, cells, records)

    @property
    def left(self) -> tuple[Cell, ...]:
        """The cells that are not done, in their order."""
        return tuple(cell for cell in self.cells if cell.folder not in self.records)

    def state(self, cell: Cell) -> str:
        """DONE, BEGUN or LEFT."""
        return DONE if cell.folder in self.records else BEGUN if cell.bundle.exists() else LEFT

    def expected(self) -> Expectations:
        """What its cells take, by those that are done."""
        found = Expectations(self.plan.memory_mb)
        for cell in self.cells:
            if cell.folder in self.records:
                found.learn(cell, self.records[cell.folder])
        return found


@contextlib.contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Within its ``with`` block no other process runs the experiment in the folder, which is made where it is missing.

    Raises ExperimentError where one does.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / LOCK).open("ab") as file:
        if not try_lock(file):
            raise ExperimentError(
                "another process runs this experiment", where=folder, cure="Wait until it has ended, or end it."
            )
        yield


class Tables:
    """An experiment's tables, written anew as its cells are done; of thousands, not after each."""

    def __init__(self, found: Experiment) -> None:
        self._found, self._sparing = found, Sparing()

    def write(self, at_the_end: bool = False) -> None:
        """Where they are due; at the end they always are. Raises OSError."""
        found = self._found
        self._sparing(lambda: gather(found.plan, found.cells, found.records, found.folder), at_the_end)


def run_experiment(
    plan: Plan,
    folder: Path,
    processes: int = 0,
    progress: Progress = SILENT,
    program: Sequence[str] = PROGRAM,
    cluster: contextlib.AbstractContextManager[Runner] | None = None,
    store: ObjectStore | None = None,
) -> tuple[Experiment, Mapping[Path, str]]:
    """Run what is left of a plan, with tables as cells are done; the experiment, and the cells that failed, with why.

    At most ``processes`` cells run at once on this machine (0: as many as fit), unless a ``cluster`` is opened for
    them. ``program`` is what each command of a cell is given to. With a ``store`` cells take what they need from
    there, and leave there what they made; in the folder is what tables need. Raises ExperimentError as ``alone``,
    ``Experiment.of`` and ``put_scenes``, and what opening the cluster does.
    """
    with alone(folder):
        found = Experiment.of(plan, folder, progress)
        records = dict(found.records)
        found = Experiment(plan, found.folder, found.cells, records)  # which grows
        progress.message(f"{counted(len(found.cells), 'cell')}, {len(records)} done before")
        tables = Tables(found)
        tables.write()

        def told(cell: Cell, outcome: Outcome, again: bool) -> None:
            if outcome.record is None:
                rest = "; it is tried again" if again else ""
                progress.message(f"{cell.name}: {outcome.failure}{rest}", "warning")
                return
            records[cell.folder] = outcome.record
            if store is not None:
                try:
                    bring(cell, store)
                except ExperimentError as error:
                    progress.message(str(error), "warning")
            progress.message(f"{cell.name}: done")
            tables.write()

        if not found.left:
            return found, {}
        # Named as on this machine only where it is another: a node has its own Python.
        do: RunCell = run_cell if program is PROGRAM else functools.partial(run_cell, program=program)
        if store is not None:
            put_scenes(found.left, store)
            do = StoredCells(store, do)
        try:
            with cluster or contextlib.nullcontext(LocalRunner(processes)) as runner:
                failures = schedule(found.left, runner, do, found.expected(), told, progress.message)
        finally:
            tables.write(at_the_end=True)
        return found, failures

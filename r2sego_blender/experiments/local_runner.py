"""Cells on this machine: as many at once as its cores and its free memory allow."""

from __future__ import annotations

import queue
import threading
from dataclasses import dataclass, field

from ..core.resources import available_cores, available_memory_mb
from .cells import Cell
from .running import Outcome, RunCell, failure

_SHARE_OF_MEMORY = 0.9


def _free_mb() -> float:
    return available_memory_mb() * _SHARE_OF_MEMORY


@dataclass(frozen=True)
class LocalRunner:
    """A runner whose cells are threads of this process, each with commands of its own.

    At most ``processes`` cells run at once (0: as many as there are cores for their threads), within ``memory_mb``:
    by default nine tenths of what is free at first.
    """

    processes: int = 0
    memory_mb: float = field(default_factory=_free_mb)
    _ended: queue.SimpleQueue[tuple[Cell, Outcome]] = field(default_factory=queue.SimpleQueue, repr=False)

    def at_once(self, threads: int) -> int:
        """As declared, else by the cores."""
        return self.processes or max(1, available_cores() // threads)

    def fits(self, needs_mb: float, taken_mb: float) -> bool:
        """Whether the memory is free."""
        return taken_mb + needs_mb <= self.memory_mb

    def start(self, cell: Cell, run_cell: RunCell, needs_mb: float) -> None:
        """In a thread of its own: on Linux a cell's command ends with the thread that started it."""

        def do() -> None:
            try:
                outcome = run_cell(cell)
            except Exception as error:  # else the cell would be waited for without end
                outcome = failure(cell, error)
            self._ended.put((cell, outcome))

        threading.Thread(target=do, name=cell.name, daemon=True).start()

    def ended(self, timeout_s: float | None) -> tuple[Cell, Outcome] | None:
        """The next that has ended."""
        try:
            return self._ended.get(timeout=timeout_s)
        except queue.Empty:
            return None

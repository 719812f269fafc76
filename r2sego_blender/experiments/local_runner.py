"""Many cells on this machine: as many at once as fit, failed ones again, and when all will be done.

Another scheduler, such as a cluster's, is given the same: cells, how one is done, and whom to tell (``Scheduler``).
"""

from __future__ import annotations

import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from ..core.formatting import counted, duration
from ..core.resources import available_cores, available_memory_mb
from .cells import Cell, Group
from .records import Record
from .running import Outcome, RunCell

_LOOK_S = 0.5  # while a cell waits for what another makes for it
_SHARE_OF_MEMORY = 0.9
_MORE_THAN_MEASURED = 1.2

Told = Callable[[Cell, Outcome, bool], None]
"""Hears of each cell that ended, how, and whether it is tried again."""


class Scheduler(Protocol):
    """Does cells by ``run_cell`` and tells how each ended; the failures that were left, by the cells' folders."""

    def __call__(self, cells: Sequence[Cell], run_cell: RunCell, told: Told) -> Mapping[Path, str]: ...


@dataclass
class Expectations:
    """What cells take, as those that are done took it: seconds on the clock, and memory at once, MB.

    ``otherwise_mb`` is what a cell needs where nothing is known of its like.
    """

    otherwise_mb: int
    _seconds: dict[Group, list[float]] = field(default_factory=dict)
    _peaks_mb: dict[Group, float] = field(default_factory=dict)

    def learn(self, cell: Cell, record: Record) -> None:
        """From a cell that is done."""
        self._seconds.setdefault(cell.group, []).append(record.seconds)
        if record.peak_mb is not None:
            self._peaks_mb[cell.group] = max(record.peak_mb, self._peaks_mb.get(cell.group, 0.0))

    def needs_mb(self, cell: Cell) -> float:
        """A fifth more than the most that one of its group took."""
        measured = self._peaks_mb.get(cell.group)
        return self.otherwise_mb if measured is None else _MORE_THAN_MEASURED * measured

    def seconds(self, cell: Cell) -> float | None:
        """The mean of its group, else of all; None while none is done."""
        taken = self._seconds.get(cell.group) or [one for each in self._seconds.values() for one in each]
        return sum(taken) / len(taken) if taken else None

    def left_s(self, waiting: Sequence[Cell], running: Mapping[Cell, float], processes: int) -> float | None:
        """Seconds until all are done; ``running`` cells have run for so long. None while no cell is done."""
        rests = [(self.seconds(cell), gone_s) for cell, gone_s in [*((one, 0.0) for one in waiting), *running.items()]]
        if any(whole is None for whole, _ in rests):
            return None
        left = [max(0.0, (whole or 0.0) - gone_s) for whole, gone_s in rests]
        at_once = max(1, min(processes, len(left)))
        return max(sum(left) / at_once, max(left, default=0.0))


@dataclass(frozen=True)
class LocalRunner:
    """A scheduler on this machine.

    At most ``processes`` cells run at once (0: as many as there are cores for their threads), and no more than fit
    the memory that is free; one always runs. A cell that fails is tried ``attempts`` times in all, after the others.
    ``say`` is given a line after each.
    """

    expected: Expectations
    processes: int = 0
    attempts: int = 2
    say: Callable[[str], None] = lambda line: None
    memory_mb: float | None = None

    def __call__(self, cells: Sequence[Cell], run_cell: RunCell, told: Told) -> Mapping[Path, str]:
        waiting, tries, failures = deque(cells), dict.fromkeys(cells, 0), dict[Path, str]()
        started: dict[Cell, float] = {}
        ended: queue.SimpleQueue[tuple[Cell, Outcome]] = queue.SimpleQueue()
        most = self.processes or max(1, available_cores() // max((cell.threads for cell in cells), default=1))
        free_mb = available_memory_mb() * _SHARE_OF_MEMORY if self.memory_mb is None else self.memory_mb

        def do(cell: Cell) -> None:
            ended.put((cell, run_cell(cell)))

        done = 0
        while waiting or started:
            while len(started) < most and (cell := self._next(waiting, started, free_mb)) is not None:
                waiting.remove(cell)
                started[cell] = time.monotonic()
                # A thread of its own: on Linux a cell's command ends with the thread that started it.
                threading.Thread(target=do, args=(cell,), name=cell.name, daemon=True).start()
            try:
                cell, outcome = ended.get(timeout=_LOOK_S if waiting and len(started) < most else None)
            except queue.Empty:
                continue
            del started[cell]
            tries[cell] += 1
            again = outcome.record is None and tries[cell] < self.attempts
            if outcome.record is not None:
                done += 1
                self.expected.learn(cell, outcome.record)
            elif again:
                waiting.append(cell)
            else:
                failures[cell.folder] = outcome.failure
            told(cell, outcome, again)
            if waiting or started:
                gone = {one: time.monotonic() - since for one, since in started.items()}
                self.say(progress_line(done, len(cells), len(failures), self.expected.left_s(waiting, gone, most)))
        return failures

    def _next(self, waiting: Sequence[Cell], running: Mapping[Cell, float], free_mb: float) -> Cell | None:
        """The first cell that can begin: it waits for nothing that another makes, and its memory is free."""
        made = {cell.shared for cell in running}
        left_mb = free_mb - sum(map(self.expected.needs_mb, running))
        for cell in waiting:
            if cell.shared is not None and cell.shared in made:
                continue
            if not running or self.expected.needs_mb(cell) <= left_mb:
                return cell
        return None


def progress_line(done: int, cells: int, failed: int, left_s: float | None) -> str:
    """How many are done, and when all will be."""
    told = f"{done} of {counted(cells, 'cell')} done"
    told += f", {failed} failed" if failed else ""
    if left_s is None:
        return told
    at = time.strftime("%H:%M" if left_s < 12 * 3600 else "%Y-%m-%d %H:%M", time.localtime(time.time() + left_s))
    return f"{told}; all will be in about {duration(left_s)}, at {at}"

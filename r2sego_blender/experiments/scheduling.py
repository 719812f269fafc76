"""Many cells, wherever they run: which begins next, what is tried again, and when all will be done.

``schedule`` is the whole of it; a ``Runner`` does single cells, on this machine (``local_runner``) or on a cluster
(``ray_runner``).
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, Protocol

from ..core.formatting import counted, duration
from .cells import Cell, Group
from .records import Record
from .running import Outcome, RunCell

ATTEMPTS = 2
"""How often a cell is tried that fails."""

LOSSES = 3
"""How often a cell goes on elsewhere whose machine was lost, before that counts as a failure of its own."""

_LOOK_S = 0.5  # while a cell waits for room, or for what another makes for it
_PAUSE = 50.0  # times as long as the work took
_MORE_THAN_MEASURED = 1.2

Told = Callable[[Cell, Outcome, bool], None]
"""Hears of each cell that ended, how, and whether it is tried again."""


class Runner(Protocol):
    """Does cells somewhere, several at once."""

    def at_once(self, threads: int) -> int:
        """How many cells of so many threads run side by side, as things are now."""
        ...

    def fits(self, needs_mb: float, taken_mb: float) -> bool:
        """Whether a cell that needs so much memory may begin beside those that take ``taken_mb`` together."""
        ...

    def start(self, cell: Cell, run_cell: RunCell, needs_mb: float) -> None:
        """Begin a cell, and return at once."""
        ...

    def ended(self, timeout_s: float | None) -> tuple[Cell, Outcome] | None:
        """The next cell that has ended, waited for so long (None: until there is one); None where none has."""
        ...


class Sparing:
    """Work that takes as long as there are cells, and may be left out: at most a fiftieth of the time goes there."""

    def __init__(self) -> None:
        self._due_s = -math.inf

    def __call__(self, work: Callable[[], None], certainly: bool = False) -> None:
        """Do it where it is due, or where it must be."""
        began_s = time.monotonic()
        if certainly or began_s >= self._due_s:
            work()
            ended_s = time.monotonic()
            self._due_s = ended_s + _PAUSE * (ended_s - began_s)


class _Taken(NamedTuple):
    cells: int = 0
    seconds: float = 0.0


@dataclass
class Expectations:
    """What cells take, as those that are done took it: seconds on the clock, and memory at once, MB.

    ``otherwise_mb`` is what a cell needs where nothing is known of its like.
    """

    otherwise_mb: int
    _seconds: dict[Group | None, _Taken] = field(default_factory=dict)  # None: of all groups together
    _peaks_mb: dict[Group, float] = field(default_factory=dict)

    def learn(self, cell: Cell, record: Record) -> None:
        """From a cell that is done."""
        for group in (cell.group, None):
            before = self._seconds.get(group, _Taken())
            self._seconds[group] = _Taken(before.cells + 1, before.seconds + record.seconds)
        if record.peak_mb is not None:
            self._peaks_mb[cell.group] = max(record.peak_mb, self._peaks_mb.get(cell.group, 0.0))

    def needs_mb(self, cell: Cell) -> float:
        """A fifth more than the most that one of its group took."""
        measured = self._peaks_mb.get(cell.group)
        return self.otherwise_mb if measured is None else _MORE_THAN_MEASURED * measured

    def seconds(self, cell: Cell) -> float | None:
        """The mean of its group, else of all; None while none is done."""
        taken = self._seconds.get(cell.group) or self._seconds.get(None)
        return taken.seconds / taken.cells if taken else None

    def left_s(self, waiting: Sequence[Cell], running: Mapping[Cell, float], processes: int) -> float | None:
        """Seconds until all are done; ``running`` cells have run for so long. None while no cell is done."""
        rests = [(self.seconds(cell), gone_s) for cell, gone_s in [*((one, 0.0) for one in waiting), *running.items()]]
        if any(whole is None for whole, _ in rests):
            return None
        left = [max(0.0, (whole or 0.0) - gone_s) for whole, gone_s in rests]
        at_once = max(1, min(processes, len(left)))
        return max(sum(left) / at_once, max(left, default=0.0))


def schedule(
    cells: Sequence[Cell],
    runner: Runner,
    run_cell: RunCell,
    expected: Expectations,
    told: Told,
    say: Callable[[str], None] = lambda line: None,
    attempts: int = ATTEMPTS,
) -> Mapping[Path, str]:
    """Do cells by ``run_cell`` and tell how each ended; the failures that were left, by the cells' folders.

    No more begin than the ``runner`` has room for, and one always does. A cell that fails is tried ``attempts`` times
    in all, after the others; one whose machine was lost goes on as the next. ``say`` is given a line after each, of
    thousands after some.
    """
    waiting, tries, losses = deque(cells), dict.fromkeys(cells, 0), dict.fromkeys(cells, 0)
    failures = dict[Path, str]()
    started: dict[Cell, float] = {}
    making: dict[Cell, Path | None] = {}
    threads = max((cell.threads for cell in cells), default=1)
    sparing, done, most = Sparing(), 0, 1

    def line() -> str:
        gone = {one: time.monotonic() - since for one, since in started.items()}
        return progress_line(done, len(cells), len(failures), expected.left_s(waiting, gone, most))

    while waiting or started:
        most = max(1, runner.at_once(threads))
        while len(started) < most and (cell := _next(waiting, making, expected, runner)) is not None:
            waiting.remove(cell)
            started[cell], making[cell] = time.monotonic(), cell.shared
            runner.start(cell, run_cell, expected.needs_mb(cell))
        if (found := runner.ended(_LOOK_S if waiting else None)) is None:
            continue
        cell, outcome = found
        del started[cell], making[cell]
        again = False
        if outcome.record is not None:
            done += 1
            expected.learn(cell, outcome.record)
        elif outcome.lost and losses[cell] < LOSSES:
            losses[cell] += 1
            again = True
            waiting.appendleft(cell)
        else:
            tries[cell] += 1
            again = tries[cell] < attempts
            if again:
                waiting.append(cell)
            else:
                failures[cell.folder] = outcome.failure
        told(cell, outcome, again)
        if waiting or started:
            sparing(lambda: say(line()))
    return failures


def _next(
    waiting: Sequence[Cell], making: Mapping[Cell, Path | None], expected: Expectations, runner: Runner
) -> Cell | None:
    """The first cell that can begin: it waits for nothing that one of those under way makes, and its memory is free."""
    made = {*making.values()}
    taken_mb = sum(map(expected.needs_mb, making))
    for cell in waiting:
        if (shared := cell.shared) is not None and shared in made:
            continue
        if not making or runner.fits(expected.needs_mb(cell), taken_mb):
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

"""Cells that say how many of them run, and a schedule of some."""

from __future__ import annotations

import threading
import time

from r2sego_blender.experiments.records import Record, Stage
from r2sego_blender.experiments.running import Outcome
from r2sego_blender.experiments.scheduling import ATTEMPTS, Expectations, schedule


def record(seconds=1.0, peak_mb=None):
    return Record("", {}, {}, (Stage("refine", seconds, None, peak_mb),), {}, {}, 0.0)


class Watched:
    """Does cells once ``at_once`` of them were running, and sees how many are."""

    def __init__(self, at_once=1, failing=(), needs=lambda cell: 0.0):
        self.at_once, self.failing, self.needs = at_once, failing, needs
        self.changed, self.running, self.most, self.most_mb, self.done = threading.Condition(), [], 0, 0.0, []

    def __call__(self, cell):
        with self.changed:
            self.running.append(cell)
            self.most = max(self.most, len(self.running))
            self.most_mb = max(self.most_mb, sum(map(self.needs, self.running)))
            self.changed.notify_all()
            self.changed.wait_for(lambda: self.most >= self.at_once, timeout=30.0)
        time.sleep(0.02)  # one too many would have begun
        with self.changed:
            self.running.remove(cell)
            self.done.append(cell)
        return Outcome(None, "it broke") if cell.seed in self.failing else Outcome(record())


def scheduled(cells, runner, run_cell, otherwise_mb=1, attempts=ATTEMPTS):
    """The failures, and each (cell, whether it is tried again) as it was told."""
    told = []

    def hear(cell, outcome, again):
        told.append((cell, again))

    return schedule(cells, runner, run_cell, Expectations(otherwise_mb), hear, attempts=attempts), told

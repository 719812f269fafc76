"""Cells on one machine: never more than fit, each as often as it may be, and when all will be done."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest
from fake_experiment import PROGRAM, finished
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.experiments.cells import cells_of
from r2sego_blender.experiments.experiment import run_experiment
from r2sego_blender.experiments.inputs import fixed_inputs
from r2sego_blender.experiments.local_runner import Expectations, LocalRunner, progress_line
from r2sego_blender.experiments.records import Record, Stage
from r2sego_blender.experiments.running import Outcome, run_cell


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


@pytest.fixture
def cells(plan, tmp_path):
    found = cells_of(plan, fixed_inputs(plan, tmp_path / "out", write=False), tmp_path / "out")
    for cell in found:
        cell.imported.mkdir(parents=True, exist_ok=True)
    return found


def run(cells, watched, processes=2, memory_mb=1e9, otherwise_mb=1, attempts=2):
    told = []
    runner = LocalRunner(Expectations(otherwise_mb), processes, attempts, memory_mb=memory_mb)
    failures = runner(cells, watched, lambda cell, outcome, again: told.append((cell, again)))
    return failures, told


def test_as_many_run_at_once_as_are_asked_for_and_each_once(cells):
    for processes in (1, 2, 3):
        watched = Watched(processes)
        failures, told = run(cells, watched, processes)
        assert not failures and watched.most == processes
        assert set(watched.done) == {cell for cell, _ in told} == set(cells) and len(watched.done) == len(cells)


def test_no_more_run_at_once_than_their_memory_allows_and_one_always(cells):
    for memory_mb, at_once in ((250.0, 2), (90.0, 1), (1000.0, 4)):
        watched = Watched(at_once, needs=lambda cell: 100.0)
        run(cells, watched, 4, memory_mb, 100)
        assert watched.most == at_once and watched.most_mb <= max(memory_mb, 100.0)


def test_failed_cells_are_tried_again_after_the_others_and_a_bounded_number_of_times(cells):
    watched = Watched(failing=(0,))
    failures, told = run(cells, watched, 1, attempts=3)
    failing = [cell for cell in cells if cell.seed == 0]
    assert failures == {cell.folder: "it broke" for cell in failing}
    assert watched.done[: len(cells)] == list(cells) and watched.done[len(cells) :] == failing * 2
    assert [again for cell, again in told if cell is failing[0]] == [True, True, False]


def test_what_cells_share_is_made_by_one_of_them(plan, tmp_path):
    cells = cells_of(plan, fixed_inputs(plan, tmp_path / "out", write=False), tmp_path / "out")
    making, twice = set(), []

    def make(cell):
        if cell.shared is not None:
            twice.extend([cell] if cell.shared in making else [])
            making.add(cell.shared)
            time.sleep(0.05)
            cell.imported.mkdir(parents=True, exist_ok=True)
        return Outcome(record())

    failures, told = run(cells, make, 4)
    assert not failures and len(told) == len(cells) and not twice and len(making) == 2


def test_memory_and_time_are_those_of_the_group_once_one_was_measured(cells):
    expected = Expectations(4000)
    first, of_group = cells[0], next(cell for cell in cells if cell.group == cells[0].group and cell is not cells[0])
    other = next(cell for cell in cells if cell.group != first.group)
    assert expected.needs_mb(first) == 4000 and expected.seconds(first) is None
    assert expected.left_s(cells, {}, 2) is None
    expected.learn(first, record(10.0, 500.0))
    expected.learn(first, record(20.0, 400.0))
    assert expected.needs_mb(of_group) == pytest.approx(600.0) and expected.needs_mb(other) == 4000
    assert expected.seconds(of_group) == expected.seconds(other) == 15.0
    expected.learn(other, record(60.0))
    assert expected.seconds(other) == 60.0 and expected.needs_mb(other) == 4000


@given(st.integers(1, 4), st.floats(1.0, 1e4), st.floats(0.0, 2e4))
def test_what_is_left_is_shared_by_the_processes_and_no_shorter_than_its_longest(processes, seconds, gone_s):
    expected = Expectations(1)
    cells = [_Cell(index) for index in range(4)]
    expected.learn(cells[0], record(seconds))
    left = expected.left_s(cells[1:3], {cells[3]: gone_s}, processes)
    rest = max(0.0, seconds - gone_s)
    assert left == pytest.approx(max((2 * seconds + rest) / min(processes, 3), seconds))
    assert expected.left_s([], {cells[3]: gone_s}, processes) == pytest.approx(rest)


class _Cell:
    """A cell as far as it is expected."""

    def __init__(self, index):
        self.folder, self.group = Path(f"{index}"), ("paper", "room", 6)


def test_one_line_says_how_many_and_when():
    assert progress_line(0, 3, 0, None) == "0 of 3 cells done"
    line = progress_line(1, 3, 1, 5400.0)
    assert line.startswith("1 of 3 cells done, 1 failed; ") and "1 h 30 min" in line
    assert time.strftime("%H:%M", time.localtime(time.time() + 5400.0))[:3] in line


def test_another_scheduler_is_given_the_same_cells(two_cells, control, tmp_path):
    def backwards(cells, run_one, told):
        for cell in reversed(cells):
            told(cell, run_one(cell), False)
        return {}

    found, failures = run_experiment(two_cells, tmp_path / "out", program=PROGRAM, scheduler=backwards)
    assert not found.left and not failures
    assert finished(control, "evaluate") == [str(cell.bundle) for cell in reversed(found.cells)]


def test_a_cell_whose_captures_another_made_meanwhile_goes_on(plan, control, tmp_path):
    """As two nodes of a cluster may: the one that came second finds it there."""
    cells = cells_of(plan, fixed_inputs(plan, tmp_path / "out", write=False), tmp_path / "out")
    threads = [threading.Thread(target=run_cell, args=(cell, PROGRAM)) for cell in cells if cell.captures == 3]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all((cell.folder / "record.json").is_file() for cell in cells if cell.captures == 3)

"""What is scheduled wherever it runs: which cells are tried again, how often, and when all will be done."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest
from fake_experiment import PROGRAM, finished
from hypothesis import given
from hypothesis import strategies as st
from killable_runner import KillableRunner
from progress_recorder import ProgressRecorder
from watched_cells import Watched, record, scheduled

from r2sego_blender.experiments.cells import cells_of
from r2sego_blender.experiments.experiment import run_experiment
from r2sego_blender.experiments.gathering import LATEX, MARKDOWN
from r2sego_blender.experiments.inputs import fixed_inputs
from r2sego_blender.experiments.local_runner import LocalRunner
from r2sego_blender.experiments.running import Outcome
from r2sego_blender.experiments.scheduling import ATTEMPTS, LOSSES, Expectations, progress_line


def test_failed_cells_are_tried_again_after_the_others_and_a_bounded_number_of_times(cells):
    watched = Watched(failing=(0,))
    failures, told = scheduled(cells, LocalRunner(1, 1e9), watched, attempts=3)
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

    failures, told = scheduled(cells, LocalRunner(4, 1e9), make)
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


def test_a_cell_whose_machine_is_lost_goes_on_as_the_next_and_not_for_ever(cells):
    begun = []

    def lost_or_done(cell):
        begun.append(cell)
        return Outcome(None, "it is gone", lost=True) if cell is cells[0] else Outcome(record())

    failures, told = scheduled(cells, LocalRunner(1, 1e9), lost_or_done)
    assert begun[: LOSSES + 1] == [cells[0]] * (LOSSES + 1) and begun[LOSSES + 1 : -1] == list(cells[1:])
    assert begun.count(cells[0]) == LOSSES + ATTEMPTS and failures == {cells[0].folder: "it is gone"}
    assert [again for cell, again in told if cell is cells[0]] == [True] * (LOSSES + ATTEMPTS - 1) + [False]


@pytest.mark.skipif(os.name == "nt", reason="a killed process takes its commands along on Linux and macOS")
def test_cells_in_processes_that_are_killed_come_to_the_same_and_none_twice(plan, control, tmp_path):
    """As on a cluster: cells go to another process and back, which dies in the midst of two of them."""
    (control / "held").touch()
    recorder, runner = ProgressRecorder(), KillableRunner(2)

    def after_both_wait():
        if not runner.killed and len(list(control.glob("waiting-*"))) == 2:
            (control / "held").unlink()
            runner.kill_all()

    runner.look = after_both_wait
    found, failures = run_experiment(plan, tmp_path / "out", 0, recorder, PROGRAM, runner.opened())
    assert not failures and not found.left and runner.killed == 2
    assert sum("lost" in text and text.endswith("it is tried again") for text in recorder.warnings) == 2
    run_experiment(plan, tmp_path / "local", 2, program=PROGRAM)
    for name in (MARKDOWN, LATEX, "figures/captures-paper+room.svg"):
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "local" / name).read_bytes()
    ended = finished(control, "evaluate")
    assert len(ended) == len(set(ended)) == 8 and len(finished(control, "new")) == 4

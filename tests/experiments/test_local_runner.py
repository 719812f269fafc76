"""Cells on one machine: never more than fit, and each once."""

from __future__ import annotations

from watched_cells import Watched, scheduled

from r2sego_blender.experiments.local_runner import LocalRunner


def run(cells, watched, processes, memory_mb=1e9, otherwise_mb=1):
    return scheduled(cells, LocalRunner(processes, memory_mb), watched, otherwise_mb)


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


def test_by_default_as_many_run_as_there_are_cores_for_their_threads(monkeypatch):
    monkeypatch.setattr("r2sego_blender.experiments.local_runner.available_cores", lambda: 8)
    assert [LocalRunner().at_once(threads) for threads in (1, 3, 16)] == [8, 2, 1]
    assert LocalRunner(5).at_once(4) == 5


def test_a_cell_that_ends_with_an_error_of_any_type_has_failed_and_is_not_waited_for(cells):
    def do(cell):
        raise ValueError("embedded null byte")

    runner = LocalRunner(1, 1e9)
    runner.start(cells[0], do, 1.0)
    cell, outcome = runner.ended(10.0) or (None, None)
    assert cell is cells[0] and outcome.record is None and "ValueError: embedded null byte" in outcome.failure

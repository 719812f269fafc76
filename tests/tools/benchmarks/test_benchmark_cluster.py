"""The bench of a cluster: what it refuses, and cells that go on where they stood."""

import importlib.util
import sys

import pytest

from r2sego_blender.core.errors import SettingsError
from r2sego_blender.experiments.experiment import run_experiment
from tools.benchmarks import cluster as bench
from tools.benchmarks.sleeping.cells import SleepingCells


def test_too_few_cells_or_no_time_is_told():
    for cells, seconds in ((7, 10.0), (24, 0.0)):
        with pytest.raises(SettingsError):
            bench.bench_cluster(cells, seconds)


def test_sleeping_cells_go_on_where_they_stood_and_share_no_journal(tmp_path):
    steps = {"new": [], "refine": [("first", 0.0), ("second", 0.1)], "evaluate": [("report", 0.0)]}
    cells = SleepingCells.of(tmp_path, steps, seeds=2)
    found, failures = run_experiment(cells.plan, tmp_path / "out", 2, program=cells.program)
    assert not failures and not found.left
    assert len(cells.finished("new")) == 1 and len(set(cells.finished("evaluate"))) == 2
    for cell in found.cells:
        record = found.records[cell.folder]
        assert list(record.steps) == ["first", "report", "second"] and record.steps["second"] == 0.1
        assert record.seconds >= 0.1
    assert (found.cells[0].imported / "journal.jsonl").read_text() == ""


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="make install CLUSTER=1")
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="nodes are killed with all they started")
def test_no_cell_is_lost_or_done_twice_as_a_node_and_the_experiment_are_killed():
    figures = bench.bench_cluster(12, 2.0)
    assert (figures["right"], figures["lost"], figures["twice"]) == (12, 0, 0)

"""Cells on Ray: what a node refuses; where Ray is installed, the same tables as here, and nothing left or heard."""

from __future__ import annotations

import importlib.util
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from click.testing import CliRunner
from fake_experiment import FAKE, PROGRAM, finished
from watched_cells import record

from r2sego_blender.commands.cli import main
from r2sego_blender.core.errors import MachineError
from r2sego_blender.experiments import ray_runner as module
from r2sego_blender.experiments.experiment import run_experiment
from r2sego_blender.experiments.gathering import LATEX, MARKDOWN
from r2sego_blender.experiments.ray_runner import AUTO, do_on_node, ray_runner
from r2sego_blender.experiments.running import Outcome

needs_ray = pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="make install CLUSTER=1")
on_linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="/proc tells what listens")


def test_a_node_of_another_version_or_without_the_disk_refuses_a_cell_and_says_why(cells):
    done = []

    def do(cell):
        done.append(cell)
        return Outcome(record())

    unseen = do_on_node(do, cells[0], module.__version__)
    assert unseen.record is None and str(cells[0].folder) in unseen.failure
    cells[0].folder.mkdir(parents=True)
    older = do_on_node(do, cells[0], "0.0.1")
    assert older.record is None and "0.0.1" in older.failure and not done
    assert do_on_node(do, cells[0], module.__version__).record == record() and done == [cells[0]]


def test_without_the_package_or_a_cluster_the_cure_is_told(monkeypatch):
    monkeypatch.setattr(module.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MachineError, match="CLUSTER=1"), ray_runner(AUTO):
        pass
    monkeypatch.setattr(module.importlib.util, "find_spec", lambda name: True)
    for nobody in ("127.0.0.1:1", "nothing"):
        with pytest.raises(MachineError, match=nobody), ray_runner(nobody):
            pass


def test_a_cluster_and_processes_are_not_asked_for_together(plan_file, tmp_path):
    asked = ["experiment", str(plan_file), "--out", str(tmp_path / "out"), "--processes", "2", "--ray", "auto"]
    assert CliRunner().invoke(main, asked).exit_code == 2 and not (tmp_path / "out").exists()


RUN = f"""
import sys
from pathlib import Path
from r2sego_blender.experiments.experiment import run_experiment
from r2sego_blender.experiments.plan import Plan
from r2sego_blender.experiments.ray_runner import AUTO, ray_runner
from r2sego_blender.workers.cancelling import cancel_at_once
cancel_at_once()
program = (sys.executable, "-S", {str(FAKE)!r})
_, failures = run_experiment(Plan.load(Path(sys.argv[1])), Path(sys.argv[2]), program=program, cluster=ray_runner(AUTO))
assert not failures, failures
"""


@needs_ray
@on_linux
def test_a_cluster_of_its_own_listens_on_loopback_alone_and_ends_with_its_process(
    plan_file, plan, control, tmp_path, monkeypatch
):
    for name in ("RAY_ADDRESS", "TMPDIR"):
        monkeypatch.delenv(name, raising=False)
    (control / "held").touch()
    before = listening()
    runner = subprocess.Popen([sys.executable, "-c", RUN, str(plan_file), str(tmp_path / "out")], cwd=module_root())
    while not (waiting := list(control.glob("waiting-*"))):
        assert runner.poll() is None
        time.sleep(0.1)
    heard = listening() - before
    assert heard and all(address in ("0100007F", LOOPBACK_6, LOOPBACK_4_IN_6) for address, _ in heard)
    runner.send_signal(signal.SIGINT)
    runner.wait(timeout=10.0)
    started_s = time.monotonic()
    while any(Path("/proc", file.name.partition("-")[2]).exists() for file in waiting):
        assert time.monotonic() - started_s < 2.0
        time.sleep(0.02)
    while listening() - before:
        assert time.monotonic() - started_s < 20.0
        time.sleep(0.1)
    (control / "held").unlink()
    subprocess.run([sys.executable, "-c", RUN, str(plan_file), str(tmp_path / "out")], cwd=module_root(), check=True)
    run_experiment(plan, tmp_path / "local", 2, program=PROGRAM)
    for name in (MARKDOWN, LATEX):
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "local" / name).read_bytes()
    ended = finished(control, "evaluate")
    assert len(ended) == len(set(ended)) == 8


LOOPBACK_6, LOOPBACK_4_IN_6 = "0" * 24 + "01000000", "0000000000000000FFFF00000100007F"


def listening():
    """(address, inode) of each socket that listens for TCP, as /proc has them."""
    lines = [line for name in ("tcp", "tcp6") for line in Path("/proc/net", name).read_text().splitlines()[1:]]
    entries = [line.split() for line in lines]
    return {(entry[1].partition(":")[0], entry[9]) for entry in entries if entry[3] == "0A"}


def module_root():
    return Path(module.__file__).parents[2]

"""Cells on Ray nodes of this machine that sleep: how much faster two workers are, and what survives being killed.

Each node is a ``ray start`` of its own on loopback with one core. A node is killed with SIGKILL in the midst of its
cell, and so is the experiment's process, which is then started anew.
"""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from r2sego_blender.commands.bench_defaults import CLUSTER_CELLS, CLUSTER_SECONDS
from r2sego_blender.core.errors import MachineError, SettingsError
from r2sego_blender.core.json_files import write_json
from r2sego_blender.core.progress import SILENT, Progress, TerminalProgress
from r2sego_blender.core.resources import processor
from r2sego_blender.experiments.experiment import Experiment, run_experiment
from r2sego_blender.experiments.ray_runner import START, RayRunner, ray_runner
from r2sego_blender.workers.processes import end_tree, ended_with_this_process, group_of_its_own

from .sleeping.cells import SleepingCells

NODES = 4
TAKEN = "taken.json"

# Ray makes of 127.0.0.1 the machine's own address, and listens on all there are; its variable against that
# (ray_runner) is for a cluster of one node, or for who asks it.
_RAY = f"""
from ray._private import services
services.get_node_ip_address = lambda address=None: "127.0.0.1"
{START}
"""
_ASKING = {"RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0"}

_CELLS_A_WORKER = 6  # of the comparison, if there are two
_STEPS = 20
_MOST_S, _PAUSE_S = 900.0, 0.05


def bench_cluster(
    cells: int = CLUSTER_CELLS, seconds: float = CLUSTER_SECONDS, progress: Progress = SILENT
) -> dict[str, Any]:
    """Run ``cells`` of ``seconds`` on four nodes; kill one of these, and the experiment, on the way.

    Returns JSON-ready figures: seconds that a few cells take on one worker and on two; what of the worker's time went
    anywhere but into cells' commands; and how many of the cells came to their end, how often, and how many rightly.
    Raises SettingsError for too few cells, MachineError without Ray.
    """
    if cells < 2 * NODES or not seconds > 0.0:
        raise SettingsError(
            "that is too little", where="--cells, --seconds", cure=f"Give {2 * NODES} cells at least, and some time."
        )
    with tempfile.TemporaryDirectory(prefix="r2sego-cluster-") as folder, progress.task("Cluster", 3) as task:
        work = Path(folder)
        with _Nodes(work / "ray") as nodes:
            nodes.start()
            one = _compared(work / "one", seconds, 2 * _CELLS_A_WORKER, nodes)
            task.advance()
            nodes.start()
            two = _compared(work / "two", seconds, 2 * _CELLS_A_WORKER, nodes)
            task.advance()
            while len(nodes.processes) < NODES:
                nodes.start()
            killed = _killed(work / "killed", seconds, cells, nodes)
            task.advance()
    return {
        "machine": processor(),
        "seconds": seconds,
        "cells_compared": 2 * _CELLS_A_WORKER,
        "one_worker": one,
        "two_workers": two,
        "times": one["seconds"] / two["seconds"],
        "cells": cells,
        **killed,
    }


def lines(figures: dict[str, Any]) -> list[str]:
    """The figures as lines for a person."""
    f = figures
    told = [f["machine"]]
    for name in ("one_worker", "two_workers"):
        shares = f"{100 * f[name]['scheduling']:.1f} % of the time no command ran"
        told.append(f"{name.replace('_', ' ')}: {f['cells_compared']} cells in {f[name]['seconds']:.1f} s, {shares}")
    killed = f"{f['cells']} cells of {f['seconds']:g} s on {NODES} nodes, one node and the experiment killed"
    came = f"{f['right']} right, {f['lost']} lost, {f['twice']} done twice, in {f['taken_s']:.1f} s"
    return [*told, f"two are {f['times']:.2f} times as fast as one", f"{killed}: {came}"]


class _Nodes:
    """Ray nodes of this machine, of one core each; the first is the head, without which there is no cluster."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.processes: list[subprocess.Popen] = []
        self.address = ""
        self._stack = contextlib.ExitStack()

    def __enter__(self) -> _Nodes:
        self.folder.mkdir()
        os.environ |= {"RAY_USAGE_STATS_ENABLED": "0", "RAY_AUTH_MODE": "token"}
        os.environ["RAY_AUTH_TOKEN"] = secrets.token_hex(32)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def start(self) -> None:
        """One more. Raises MachineError where none comes up."""
        ray = [sys.executable, "-c", _RAY, "start", "--block", "--node-ip-address=127.0.0.1"]
        ray += ["--num-cpus=1", f"--object-store-memory={100 << 20}", "--disable-usage-stats"]
        if self.address:
            ray += [f"--address={self.address}"]
        else:
            ray += ["--head", "--port=0", "--include-dashboard=false", f"--temp-dir={self.folder}"]
        log = self.folder / f"node_{len(self.processes)}.log"
        with log.open("wb") as file:
            process = subprocess.Popen(ray, stdin=subprocess.DEVNULL, stdout=file, stderr=file, **group_of_its_own())
        guard = ended_with_this_process(process)
        self._stack.callback(guard.communicate)
        self._stack.callback(process.wait)
        self._stack.callback(end_tree, process)
        self._stack.callback(guard.kill)
        self.processes.append(process)
        until_s = time.monotonic() + _MOST_S
        while "Ray runtime started" not in log.read_text(errors="replace"):
            if process.poll() is not None or time.monotonic() > until_s:
                raise MachineError("a Ray node does not start", where=log.name, cure=log.read_text()[-500:])
            time.sleep(_PAUSE_S)
        self.address = self.address or (self.folder / "ray_current_cluster").read_text().strip()

    def kill_last(self) -> None:
        """All of a node at once, as a machine that loses its power."""
        end_tree(self.processes[-1])


def run(work: str, address: str, cells: int, seconds: float) -> None:
    """The experiment's process: what is left of the cells in ``work``, and the seconds that this took."""
    asleep = _sleeping(Path(work), seconds, cells)
    taken: list[float] = []

    @contextlib.contextmanager
    def timed() -> Iterator[RayRunner]:
        with ray_runner(address) as runner:
            began_s = time.monotonic()
            yield runner
            taken.append(time.monotonic() - began_s)

    _, failures = run_experiment(asleep.plan, asleep.work / "out", 0, TerminalProgress(), asleep.program, timed())
    if failures:
        raise SystemExit(f"cells failed: {dict(failures)}")
    write_json(asleep.work / TAKEN, {"seconds": sum(taken)})


def _ended(driver: subprocess.Popen) -> None:
    if driver.wait(_MOST_S) != 0:
        raise SystemExit(f"the experiment ended with status {driver.returncode}")


def _sleeping(work: Path, seconds: float, cells: int) -> SleepingCells:
    refined = [(f"step {index}", 0.8 * seconds / _STEPS) for index in range(_STEPS)]
    steps = {"new": [], "refine": refined, "evaluate": [("report", 0.2 * seconds)]}
    return SleepingCells.of(work, steps, seeds=cells)


def _compared(work: Path, seconds: float, cells: int, nodes: _Nodes) -> dict[str, float]:
    """Seconds that cells take on the nodes that are there, and the share of these in which no command ran."""
    asleep = _sleeping(work, seconds, cells)
    with _driver(work, nodes.address, cells, seconds) as driver:
        _ended(driver)
    told = json.loads((work / TAKEN).read_text(encoding="utf-8"))
    busy_s = sum(record.seconds for record in Experiment.of(asleep.plan, work / "out", write=False).records.values())
    workers = len(nodes.processes)
    return {"seconds": told["seconds"], "scheduling": 1.0 - busy_s / (told["seconds"] * workers)}


def _killed(work: Path, seconds: float, cells: int, nodes: _Nodes) -> dict[str, Any]:
    """What became of cells, of which a quarter were done as a node was killed, and half as the experiment was."""
    asleep = _sleeping(work, seconds, cells)

    def until(done: int, driver: subprocess.Popen) -> None:
        while len(asleep.finished("evaluate")) < done:
            if driver.poll() is not None:
                raise SystemExit(f"the experiment ended too early, with status {driver.returncode}")
            time.sleep(_PAUSE_S)

    began_s = time.monotonic()
    with _driver(asleep.work, nodes.address, cells, seconds) as driver:
        until(cells // 4, driver)
        time.sleep(0.3 * seconds)
        nodes.kill_last()
        until(cells // 2, driver)
        time.sleep(0.3 * seconds)
        driver.kill()
        driver.wait()
    with _driver(asleep.work, nodes.address, cells, seconds) as driver:
        _ended(driver)
    taken_s = time.monotonic() - began_s
    found = Experiment.of(asleep.plan, work / "out", write=False)
    again = _sleeping(work.with_name("again"), 0.0, cells)
    local, _ = run_experiment(again.plan, again.work / "out", 2, program=again.program)
    expected = {cell.seed: local.records[cell.folder].arms for cell in local.cells}
    ended = asleep.finished("evaluate")
    right = [
        cell.seed
        for cell in found.cells
        if cell.folder in found.records
        if found.records[cell.folder].arms == expected[cell.seed]
    ]
    return {
        "right": len(right),
        "lost": cells - len(found.records),
        "twice": len(ended) - len(set(ended)),
        "refined_twice": len(asleep.finished("refine")) - len(set(asleep.finished("refine"))),
        "taken_s": taken_s,
        "least_s": cells * seconds / NODES,
    }


@contextlib.contextmanager
def _driver(work: Path, address: str, cells: int, seconds: float) -> Iterator[subprocess.Popen]:
    """The experiment in a process of its own."""
    code = f"from {__name__} import run; run({str(work)!r}, {address!r}, {cells}, {seconds})"
    root = Path(__file__).resolve().parents[2]
    with (work / "driver.log").open("ab") as log:
        driver = subprocess.Popen(
            [sys.executable, "-c", code], cwd=root, stdout=log, stderr=log, env=os.environ | _ASKING
        )
    try:
        yield driver
    finally:
        driver.kill()
        driver.wait()

"""Cells on a Ray cluster: tasks with the cores and the memory that they need, on whichever node has them free."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import secrets
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

from .. import __version__
from ..core.errors import ExperimentError, MachineError
from ..core.formatting import counted
from ..core.resources import available_cores, available_memory_mb
from ..core.scratch import ScratchFolder
from ..workers.library_path import LIBRARY
from ..workers.processes import end_tree, ended_with_this_process, group_of_its_own
from .cells import Cell
from .running import Outcome, RunCell
from .stored_cells import StoredCells

AUTO = "auto"
"""In place of an address: the cluster that runs on this machine, else one of its own."""

_NOTE = "ray_current_cluster"  # a file of `ray start`
_CURE = "Start one with `ray start --head`, and name its HOST:PORT on a node of it."

START = """
from ray._private import node
from ray.scripts.scripts import main
node.Node.start_api_server = lambda *_, **__: None
main()
"""
"""Ray's command, without the process that is left of its dashboard when it has none.

That one asks who runs this machine, an address of clouds, and tells Ray's makers that it is not to tell them anything.
"""

_MIB = 2**20
_OBJECTS_BYTES = 100 * _MIB  # tasks give back a record each
_SHARE_OF_MEMORY = 0.9
_LISTENS_S, _STARTED_S, _PAUSE_S = 5.0, 120.0, 0.1
_HEARD_S = 0.5  # in which tasks end with the process that asked for them
_MOST_WORDS = 300


class RayRunner:
    """A runner whose cells are tasks of the cluster that ``ray``, the package, is connected with."""

    def __init__(self, ray: ModuleType) -> None:
        self._ray = ray
        self._task = ray.remote(do_on_node)
        self._running: dict[Any, Cell] = {}

    def at_once(self, threads: int) -> int:
        """As many as the cores of all nodes that are there now."""
        cores = [int(node.get("CPU", 0)) for node in self._nodes()]
        each = min(threads, max(cores, default=0))
        return sum(own // each for own in cores) if each else 0

    def fits(self, needs_mb: float, taken_mb: float) -> bool:
        """The cluster finds the memory, or lets a cell wait until it is free."""
        return True

    def start(self, cell: Cell, run_cell: RunCell, needs_mb: float) -> None:
        """As a task of its own; one that needs more than any node has gets all that a node has."""
        nodes = self._nodes()
        cores = max((int(node.get("CPU", 0)) for node in nodes), default=0) or cell.threads
        memory = max((node.get("memory", 0.0) for node in nodes), default=0.0) or needs_mb * _MIB
        # Ray does not try again by itself: what was lost is told, and counted, where all cells are scheduled.
        needs = {"num_cpus": min(cell.threads, cores), "memory": int(min(needs_mb * _MIB, memory)), "max_retries": 0}
        cell.folder.mkdir(parents=True, exist_ok=True)
        task = self._task.options(name=cell.name, scheduling_strategy="SPREAD", **needs)
        self._running[task.remote(run_cell, cell, __version__)] = cell

    def ended(self, timeout_s: float | None) -> tuple[Cell, Outcome] | None:
        """The next task that has ended, or was lost with its node."""
        ended, _ = self._ray.wait([*self._running], num_returns=1, timeout=timeout_s)
        if not ended:
            return None
        cell = self._running.pop(ended[0])
        errors = self._ray.exceptions
        lost = (errors.NodeDiedError, errors.WorkerCrashedError, errors.ObjectLostError, errors.OutOfMemoryError)
        try:
            return cell, self._ray.get(ended[0])
        except lost as error:
            return cell, Outcome(None, f"its node or process was lost: {_first_line(error)}", lost=True)
        except errors.RayError as error:
            return cell, Outcome(None, f"Ray could not do it: {_last_line(error)}")

    def _nodes(self) -> list[dict[str, float]]:
        """What each node that is there has."""
        return [node["Resources"] for node in self._ray.nodes() if node["Alive"]]


@contextlib.contextmanager
def ray_runner(address: str, say: Callable[[str], None] = lambda line: None) -> Iterator[RayRunner]:
    """Within its ``with`` block a runner on the cluster at ``address``, "HOST:PORT" or AUTO.

    The cluster of its own, which AUTO starts where this machine has none, listens on loopback alone, has no
    dashboard and ends with the block, or with this process. Nothing reports its use to anyone. Raises MachineError
    without the package, or where no cluster answers.
    """
    if importlib.util.find_spec("ray") is None:
        raise MachineError(
            "a cluster needs the package ray", cure="Install the extra `cluster`: `make install CLUSTER=1`."
        )
    found = address if address != AUTO else _declared()
    if found and not _listens(found):
        raise MachineError("no Ray cluster listens there", where=found, cure=_CURE)
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    with contextlib.nullcontext(found) if found else _of_its_own() as place:
        import ray  # which reads its variables at once

        try:
            # Tasks look for modules first where this is called from: not in whatever folder a person works in.
            with contextlib.chdir(LIBRARY.parent):
                ray.init(address=place, log_to_driver=False, logging_level="ERROR")
        except (OSError, RuntimeError, ValueError, ray.exceptions.RayError) as error:
            raise MachineError(f"the cluster does not answer: {_first_line(error)}", where=place, cure=_CURE) from error
        try:
            runner, there = RayRunner(ray), counted(len(ray.nodes()), "node")
            say(f"Ray at {found}: {there}" if found else "Ray on this machine alone, for as long as this runs")
            yield runner
        finally:
            ray.shutdown()


def do_on_node(run_cell: RunCell, cell: Cell, version: str) -> Outcome:
    """A cell on a node of the cluster, which has to have this version, and to see the cell's folder or storage."""
    node = socket.gethostname()
    try:
        if version != __version__:
            raise ExperimentError(
                f"the node {node} has version {__version__}, and this experiment is run by {version}",
                where=cell.name,
                cure="Install the same version on every node.",
            )
        if not isinstance(run_cell, StoredCells) and not cell.folder.is_dir():
            raise ExperimentError(
                f"the node {node} does not see this folder",
                where=cell.folder,
                cure="Mount one disk at the same place on every node, or give storage with --store.",
            )
    except ExperimentError as error:
        return Outcome(None, str(error))
    return run_cell(cell)


def _declared() -> str:
    """The address that RAY_ADDRESS or, while it listens, `ray start` on this machine declares; "" without one."""
    if declared := os.environ.get("RAY_ADDRESS"):
        return declared
    temporary = os.environ.get("RAY_TMPDIR") or ("/tmp" if sys.platform == "darwin" else tempfile.gettempdir())
    with contextlib.suppress(OSError):
        noted = (Path(temporary) / "ray" / _NOTE).read_text(encoding="utf-8").strip()
        return noted if _listens(noted) else ""
    return ""


def _listens(address: str) -> bool:
    host, _, port = address.rpartition(":")
    try:
        with socket.create_connection((host, int(port)), _LISTENS_S):
            return True
    except (OSError, ValueError):
        return False


@contextlib.contextmanager
def _of_its_own() -> Iterator[str]:
    """Within its ``with`` block the address of a cluster of this machine alone, that listens on loopback.

    All of it ends with the block or, however that ends, with this process. Raises MachineError.
    """
    # As it is on macOS and Windows by Ray's own choice: elsewhere it makes of 127.0.0.1 the machine's own address, and
    # listens on all there are.
    os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"
    os.environ |= {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": secrets.token_hex(32)}  # other users stay out
    memory_mb = available_memory_mb() * _SHARE_OF_MEMORY
    with ScratchFolder() as name:
        folder = Path(name)
        options = {
            "node-ip-address": "127.0.0.1",
            "port": 0,
            "include-dashboard": "false",
            "num-cpus": available_cores(),
            "object-store-memory": _OBJECTS_BYTES,
            "temp-dir": folder,
        } | ({"memory": int(memory_mb * _MIB)} if memory_mb < float("inf") else {})
        command = [sys.executable, "-c", START, "start", "--head", "--block", "--disable-usage-stats"]
        command += [f"--{option}={value}" for option, value in options.items()]
        with (folder / "start.log").open("wb") as log:
            process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, **group_of_its_own(window=False)
            )
        guard = ended_with_this_process(process, _HEARD_S)
        try:
            yield _address(process, folder)
            time.sleep(_HEARD_S)
        finally:
            guard.kill()
            end_tree(process)
            process.wait()
            guard.communicate()


def _address(process: subprocess.Popen, folder: Path) -> str:
    """What `ray start` notes in its folder once it can be spoken with."""
    until_s = time.monotonic() + _STARTED_S
    note = folder / _NOTE
    while process.poll() is None and time.monotonic() < until_s:
        with contextlib.suppress(OSError):
            if address := note.read_text(encoding="utf-8").strip():
                return address
        time.sleep(_PAUSE_S)
    lines = (folder / "start.log").read_text(encoding="utf-8", errors="replace").strip().splitlines()
    raise MachineError(
        f"Ray does not start: {lines[-1][:_MOST_WORDS] if lines else 'it says nothing'}",
        where="--ray auto",
        cure="Run it with --processes, or start a cluster with `ray start --head`.",
    )


def _first_line(error: BaseException) -> str:
    return _lines(error)[0][:_MOST_WORDS]


def _last_line(error: BaseException) -> str:
    """Of an error with the traceback of another process."""
    return _lines(error)[-1][:_MOST_WORDS]


def _lines(error: BaseException) -> list[str]:
    return [line.strip() for line in str(error).splitlines() if line.strip()] or [type(error).__name__]

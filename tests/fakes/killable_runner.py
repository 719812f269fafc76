"""A runner whose cells are processes that can be killed, as a cluster's nodes are: all goes through pickles."""

from __future__ import annotations

import contextlib
import pickle
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from r2sego_blender.experiments.running import Outcome

_DO = """
import pickle, sys
from pathlib import Path
run_cell, cell = pickle.loads(Path(sys.argv[1]).read_bytes())
Path(sys.argv[2]).write_bytes(pickle.dumps(run_cell(cell)))
"""


class KillableRunner:
    """``processes`` cells at once; ``look`` is called while they are waited for."""

    def __init__(self, processes):
        self.processes, self.killed, self.look = processes, 0, lambda: None
        self._running = {}

    @contextlib.contextmanager
    def opened(self):
        with tempfile.TemporaryDirectory() as folder:
            self._folder = Path(folder)
            yield self

    def at_once(self, threads):
        return self.processes

    def fits(self, needs_mb, taken_mb):
        return True

    def start(self, cell, run_cell, needs_mb):
        files = [self._folder / f"{time.monotonic_ns()}.{end}" for end in ("in", "out")]
        files[0].write_bytes(pickle.dumps((run_cell, cell)))
        command = [sys.executable, "-c", _DO, *map(str, files)]
        process = subprocess.Popen(command, cwd=Path(__file__).parents[2])
        self._running[process] = (cell, files[1])

    def kill_all(self):
        for process in self._running:
            process.kill()
            self.killed += 1

    def ended(self, timeout_s):
        until_s = time.monotonic() + (1e9 if timeout_s is None else timeout_s)
        while time.monotonic() < until_s:
            self.look()
            for process, (cell, result) in self._running.items():
                if process.poll() is not None:
                    del self._running[process]
                    if process.returncode != 0:
                        return cell, Outcome(None, "its process was lost", lost=True)
                    return cell, pickle.loads(result.read_bytes())
            time.sleep(0.02)
        return None

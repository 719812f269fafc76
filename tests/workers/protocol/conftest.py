"""Real workers: programs of this interpreter that serve by ``serving`` and otherwise import nothing of the library."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from r2sego_blender.workers.protocol import serving
from r2sego_blender.workers.protocol.program_worker import ProgramWorker

BEGIN = f"""
import json, os, pathlib, subprocess, sys, time
sys.path.insert(0, {str(Path(serving.__file__).parent)!r})
import numpy as np
from serving import RANDOM, Answer, RefusedError, UnusableError, serve
del sys.path[0]
"""
DEPTH = """
def depth(request, progress):
    photograph = request.array("photograph")
    for done in range(3):
        progress(done + 1, 3, "looking")
    near = request.parameters["near_m"] + photograph[..., 0] / np.float32(255)
    return Answer("Stand-in 1.2", "a" * 64, {"depth": near.astype(np.float32)}, {"process": os.getpid()})
serve({"depth": depth})
"""


class Workers:
    """``workers(body)``: a worker that runs these lines of Python after ``begin``."""

    begin, depth = BEGIN, DEPTH

    def __init__(self, folder: Path) -> None:
        self._folder, self._made = folder, []

    def __call__(self, body: str = DEPTH) -> ProgramWorker:
        self._made.append(ProgramWorker([sys.executable, str(self.script(body))], "stand-in", "Mend it."))
        return self._made[-1]

    def script(self, body: str = DEPTH) -> Path:
        script = self._folder / f"worker_{len(self._made)}.py"
        script.write_text(BEGIN + body)
        return script

    def close(self) -> None:
        for one in self._made:
            one.close()


@pytest.fixture
def worker_of(tmp_path) -> Iterator[Workers]:
    (tmp_path / "workers").mkdir()
    workers = Workers(tmp_path / "workers")
    yield workers
    workers.close()

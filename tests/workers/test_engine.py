"""Which Python is the engine, and what it answers, with a stand-in for the interpreter."""

import contextlib
import os
import signal
import subprocess
import sys

import pytest
from stand_in_program import write_program

from r2sego_blender.core.errors import MachineError
from r2sego_blender.workers.engine import LIBRARY, ask, find_interpreter
from r2sego_blender.workers.processes import birth


@pytest.fixture
def interpreter(tmp_path):
    """Makes an executable whose Python body runs in place of the engine."""

    def make(body: str) -> str:
        imports = "import json, os, signal, subprocess, sys, time\n"
        return str(write_program(tmp_path / "python", imports + body))

    return make


def test_the_interpreter_is_the_chosen_one_then_the_variables_then_the_fallback(monkeypatch):
    monkeypatch.delenv("R2SEGO_PYTHON", raising=False)
    with pytest.raises(MachineError, match="R2SEGO_PYTHON"):
        find_interpreter()
    assert find_interpreter(fallback=sys.executable) == sys.executable
    monkeypatch.setenv("R2SEGO_PYTHON", "/nowhere/python")
    with pytest.raises(MachineError, match="/nowhere/python"):
        find_interpreter(fallback=sys.executable)
    assert find_interpreter(preferred=sys.executable) == sys.executable


def test_a_python_without_the_packages_is_told_so(interpreter):
    python = interpreter("raise ModuleNotFoundError(\"No module named 'click'\")")
    with pytest.raises(MachineError, match="click"):
        ask(["doctor", "--json"], python)


def test_the_real_engine_answers():
    assert ask(["--version"], sys.executable).startswith("r2sego")


@pytest.mark.skipif(os.name == "nt", reason="Windows sends no such signals")
@pytest.mark.parametrize("number", [signal.SIGTERM, getattr(signal, "SIGHUP", None)], ids=["TERM", "HUP"])
def test_who_ends_blender_ends_the_command_it_runs(interpreter, tmp_path, number):
    """As a farm's manager ends ``blender --background --python batch/refine.py``."""
    engine = interpreter(
        f"signal.signal({int(number)}, lambda *_: sys.exit(77))\nprint(os.getpid(), flush=True)\ntime.sleep(60)\n"
    )
    code = f"from r2sego_blender.workers.engine import *; raise SystemExit(run_in_terminal([], {engine!r}))"
    environment = {**os.environ, "PYTHONPATH": str(LIBRARY.parent)}
    process = subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE)
    pid = int(process.stdout.readline())
    try:
        process.send_signal(number)
        assert process.wait(30) == 77
        assert not birth(pid)
    finally:
        process.kill()
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
        process.communicate()

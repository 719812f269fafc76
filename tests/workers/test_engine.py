"""Which Python is the engine, and what it answers, with a stand-in for the interpreter."""

import os
import stat
import sys

import pytest

from r2sego_blender.errors import MachineError
from r2sego_blender.workers.engine import ask, find_interpreter

pytestmark = pytest.mark.skipif(os.name == "nt", reason="the stand-in is a script with a #! line")


@pytest.fixture
def interpreter(tmp_path):
    """Makes an executable whose Python body runs in place of the engine."""

    def make(body: str) -> str:
        path = tmp_path / "python"
        path.write_text(f"#!{sys.executable}\nimport json, os, signal, subprocess, sys, time\n{body}\n")
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
        return str(path)

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

"""The engine's process: followed, failed and cancelled, with a stand-in for the interpreter."""

import os
import stat
import sys
import time
from pathlib import Path

import pytest

from r2sego_blender.errors import MachineError
from r2sego_blender.workers.engine import LIBRARY, Engine, EngineError, ask, find_interpreter

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


def gone(pid: int) -> bool:
    stat_file = Path(f"/proc/{pid}/stat")
    return not stat_file.exists() or stat_file.read_text().rpartition(")")[2].split()[0] == "Z"


def wait_for_line(engine: Engine) -> dict:
    deadline = time.monotonic() + 10
    while time.monotonic() < deadline:
        for event in engine.events():
            return event.data
        time.sleep(0.01)
    raise AssertionError("the stand-in said nothing")


def test_it_runs_the_library_as_a_plain_package(interpreter):
    python = interpreter(
        "print(json.dumps({'event': 'result', 'argv': sys.argv[1:],"
        " 'path': os.environ['PYTHONPATH'].split(os.pathsep)[0]}))"
    )
    result = Engine(["refine", "/a scene"], python).wait()
    assert result["argv"] == ["-m", "r2sego_blender", "refine", "/a scene"]
    assert Path(result["path"]) == LIBRARY.parent


def test_events_arrive_in_order_and_other_lines_do_not_disturb(interpreter):
    python = interpreter(
        "print('a library talks')\n"
        "for done in range(3): print(json.dumps({'event': 'progress', 'task': 't', 'done': done}))\n"
        "print('[1, 2]'); print('{broken'); print(json.dumps({'no': 'event'}))\n"
        "print(json.dumps({'event': 'message', 'text': 'hello'}))"
    )
    seen = []
    assert Engine([], python).wait(seen.append) == {}
    assert [event.data.get("done", event.data.get("text")) for event in seen] == [0, 1, 2, "hello"]


def test_much_output_does_not_block(interpreter):
    python = interpreter(
        "for i in range(20000): print(json.dumps({'event': 'progress', 'done': i}))\n"
        "sys.stderr.write('x' * 300000)"
    )
    seen = []
    Engine([], python).wait(seen.append)
    assert len(seen) == 20000


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("print(json.dumps({'event': 'error', 'text': 'no photographs.'})); sys.exit(1)", "no photographs"),
        ("print('r2sego: the disk is full', file=sys.stderr); sys.exit(1)", "the disk is full"),
        ("sys.exit(3)", "exit status 3"),
        ("os.kill(os.getpid(), signal.SIGKILL)", "exit status -9"),
        ("raise ImportError('no torch')", "no torch"),
    ],
)
def test_a_failure_is_told_in_the_engines_words(interpreter, body, words):
    with pytest.raises(EngineError, match=words):
        Engine([], interpreter(body)).wait()


@pytest.mark.parametrize("ignores_interrupts", [False, True])
def test_cancel_ends_the_process_and_its_children_within_two_seconds(interpreter, ignores_interrupts):
    python = interpreter(
        ("signal.signal(signal.SIGINT, signal.SIG_IGN)\n" if ignores_interrupts else "")
        + "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)'])\n"
        "print(json.dumps({'event': 'message', 'child': child.pid, 'own': os.getpid()}), flush=True)\n"
        "time.sleep(60)"
    )
    engine = Engine([], python)
    pids = wait_for_line(engine)
    started_s = time.monotonic()
    engine.cancel()
    while engine.running():
        time.sleep(0.01)
    assert time.monotonic() - started_s < 2.0
    assert gone(pids["own"])
    time.sleep(0.05)
    assert gone(pids["child"])
    with pytest.raises(EngineError, match="cancelled"):
        engine.result()


def test_stop_waits_for_the_end(interpreter):
    engine = Engine([], interpreter("signal.signal(signal.SIGINT, signal.SIG_IGN); time.sleep(60)"))
    time.sleep(0.3)
    started_s = time.monotonic()
    engine.stop()
    assert time.monotonic() - started_s < 2.0
    assert not engine.running()


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

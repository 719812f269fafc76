"""A refinement cancelled by a script when its time is up, with pip bpy and a stand-in engine."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from stand_in_engine import write_stand_in_engine

pytest.importorskip("bpy", reason="pip bpy is not installed")

ROOT = Path(__file__).parents[3]
SCRIPT = ROOT / "batch" / "examples" / "engine_cancel.py"


@pytest.fixture
def engine(tmp_path):
    """The stand-in; its conduct stands beside it."""
    return write_stand_in_engine(tmp_path)


@pytest.fixture
def begin(bundle_path, blender_environment, engine):
    """Start the script with an engine of this conduct."""

    def begin(conduct, after_s):
        (engine.parent / "conduct.txt").write_text(conduct)
        return subprocess.Popen(
            [sys.executable, str(SCRIPT), "--", str(bundle_path), "--after", str(after_s)],
            env={**blender_environment, "R2SEGO_PYTHON": str(engine)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    return begin


def content(bundle):
    return {file: file.read_bytes() for file in bundle.rglob("*") if file.is_file() and file.name != ".lock"}


def test_when_the_time_is_up_the_job_is_cancelled(begin, bundle_path):
    before = content(bundle_path)
    script = begin("sleep", 1.5)  # a minute long
    said, wrong = script.communicate(timeout=600)
    assert script.returncode == 3, wrong + said
    took_s = float(said.partition("cancelled after ")[2].split()[0])
    assert 1.5 <= took_s < 15.0  # two seconds more on a free machine
    assert "Refine: Cancelled. Finished steps are kept" in said
    assert "2 of 2 rounds are done" in said
    assert content(bundle_path) == before


def test_what_is_done_in_time_is_not_cancelled(begin, engine, bundle_path):
    script = begin("succeed", 500)
    said, wrong = script.communicate(timeout=400)
    assert script.returncode == 0, wrong + said
    assert "finished after " in said and "Refine: Refined: 2 of 2 rounds" in said
    (call,) = [json.loads(line) for line in (engine.parent / "calls.jsonl").read_text().splitlines()]
    assert call[:2] == ["refine", str(bundle_path)]


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_control_c_cancels_too(begin, engine):
    script = begin("sleep", 500)
    calls = engine.parent / "calls.jsonl"
    deadline_s = time.monotonic() + 300.0
    while not calls.is_file() and time.monotonic() < deadline_s:
        time.sleep(0.05)
    script.send_signal(signal.SIGINT)
    said, wrong = script.communicate(timeout=400)
    assert script.returncode == 3, wrong + said
    assert "Refine: Cancelled." in said

"""The example of the room Engine, with pip bpy and a stand-in for the engine's Python."""

import json
import shutil
from functools import partial

import pytest
from example_runs import run_with_engine
from stand_in_engine import write_stand_in_engine

from r2sego_blender.workers.jobs import start_job
from r2sego_blender.workers.signed_records import read_signed, write_signed

pytest.importorskip("bpy", reason="pip bpy is not installed")


@pytest.fixture
def engine(tmp_path):
    """The stand-in, which succeeds."""
    return write_stand_in_engine(tmp_path)


@pytest.fixture
def run(blender_environment, engine):
    """Run the example with these arguments."""
    return partial(run_with_engine, "engine_setup.py", blender_environment, engine=engine)


def test_the_engine_is_asked_and_the_demo_scene_made(run, engine, bundle_path, tmp_path):
    made = tmp_path / "demo" / "demo_room.r2s"
    shutil.copytree(bundle_path, made)  # what the stand-in does not make
    done = run("--demo", made.parent)
    assert done.returncode == 0, done.stderr
    assert "engine: Python 3.99" in done.stdout
    assert "Demo Scene: Made and refined demo_room.r2s" in done.stdout
    assert f"{made}: 2 of 2 rounds" in done.stdout
    calls = [json.loads(line) for line in (engine.parent / "calls.jsonl").read_text().splitlines()]
    assert calls[-1] == ["demo", str(made), "--preset", "preview", "--json-progress"]


def test_a_job_that_was_left_behind_is_followed(run, engine, bundle_path):
    (engine.parent / "conduct.txt").write_text("slow")
    notes = {"operator": "r2sego.refine", "properties": {}, "bundle": str(bundle_path)}
    left = start_job(["refine", str(bundle_path)], str(engine), "Refine", bundle_path / ".jobs", notes=notes)
    record = read_signed(left.folder / "job.json")
    record["starter"]["birth"] = "a Blender that has ended"
    write_signed(left.folder / "job.json", record)
    done = run("--follow", bundle_path)
    assert done.returncode == 0, done.stderr
    assert "Refine: Refined: 2 of 2 rounds" in done.stdout
    assert not left.folder.exists()


def test_without_the_packages_setting_up_fails_in_one_line(run, tmp_path):
    (tmp_path / "wheels").mkdir()
    done = run("--set-up", "--wheels", tmp_path / "wheels")
    assert done.returncode == 1
    assert "the packages cannot be installed" in done.stderr and "Traceback" not in done.stderr

"""The example of the room Collision, with pip bpy and a stand-in engine."""

import json

import pytest
from example_runs import run_with_engine
from stand_in_engine import write_stand_in_engine

pytest.importorskip("bpy", reason="pip bpy is not installed")


def test_it_is_shown_checked_textured_and_exported(bundle_path, blender_environment, tmp_path):
    engine = write_stand_in_engine(tmp_path)
    arguments = [bundle_path, "--texture", "--faces", "500", "--to", tmp_path / "out"]
    arguments += ["--splats", ".spz", "--textured"]
    done = run_with_engine("collision_check.py", blender_environment, *arguments, engine=engine)
    assert done.returncode == 0, done.stderr + done.stdout
    assert "6 faces of convex pieces" in done.stdout and "not passed" in done.stdout
    calls = [json.loads(line) for line in (engine.parent / "calls.jsonl").read_text().splitlines()]
    assert [call[0] for call in calls] == ["check-collision", "texture", "export"]
    asked = ["--to", str(tmp_path / "out"), "--json-progress", "--splats", ".spz", "--textured"]
    assert calls[2][2:] == asked

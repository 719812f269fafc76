"""The example of the room Collision, with pip bpy and a stand-in engine."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from stand_in_engine import write_stand_in_engine

pytest.importorskip("bpy", reason="pip bpy is not installed")

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "batch" / "examples" / "collision_check.py"


def test_it_is_shown_checked_textured_and_exported(bundle_path, blender_environment, tmp_path):
    engine = write_stand_in_engine(tmp_path)
    arguments = [bundle_path, "--texture", "--faces", "500", "--to", tmp_path / "out", "--splats", ".spz"]
    done = subprocess.run(
        [sys.executable, str(SCRIPT), "--", *map(str, arguments)],
        env={**blender_environment, "R2SEGO_PYTHON": str(engine)},
        capture_output=True, text=True, timeout=1200,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr + done.stdout
    assert "6 faces of convex pieces" in done.stdout and "not passed" in done.stdout
    calls = [json.loads(line) for line in (engine.parent / "calls.jsonl").read_text().splitlines()]
    assert [call[0] for call in calls] == ["check-collision", "texture", "export"]
    assert calls[2][2:] == ["--to", str(tmp_path / "out"), "--splats", ".spz"]

"""The example of the room Scene, with pip bpy."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("bpy", reason="pip bpy is not installed")

SCRIPT = Path(__file__).parents[3] / "batch" / "examples" / "scene_settings.py"


@pytest.fixture
def run(blender_environment, tmp_path):
    """Run the script with an engine that answers at once and notes what it was asked."""
    engine = tmp_path / "engine"
    engine.write_text(
        f"#!{sys.executable}\nimport json, sys\nfrom pathlib import Path\n"
        f"Path({str(tmp_path / 'asked.json')!r}).write_text(json.dumps(sys.argv[3:]))\n"
        "print(json.dumps({'event': 'result'}))\n"
    )
    engine.chmod(0o755)

    def run(*arguments):
        return subprocess.run(
            [sys.executable, str(SCRIPT), "--", *map(str, arguments)],
            env={**blender_environment, "R2SEGO_PYTHON": str(engine)},
            capture_output=True,
            text=True,
            timeout=1200,
        )

    return run


def test_settings_are_kept_taken_and_refined_with(run, bundle_path, tmp_path):
    done = run(bundle_path, "--reset", "--set", "rounds=2", "--set", "training.steps_per_round=50", "--keep", "quick")
    assert done.returncode == 0, done.stderr
    assert "rounds = 2" in done.stdout and "training.steps_per_round = 50" in done.stdout
    assert "captures, Photos: 3" in done.stdout
    done = run(bundle_path, "--reset", "--preset", "paper", "--use", "quick", "--refine")
    assert done.returncode == 0, done.stderr
    asked = json.loads((tmp_path / "asked.json").read_text())
    assert asked[:2] == ["refine", str(bundle_path)]
    assert "rounds=2" in asked and "training.steps_per_round=50" in asked
    assert run(bundle_path, "--remove", "quick").returncode == 0
    failed = run(bundle_path, "--use", "quick")
    assert failed.returncode == 1
    assert "no settings are kept as 'quick'" in failed.stderr and "Traceback" not in failed.stderr


def test_photographs_become_a_scene(run, bundle_path, tmp_path):
    done = run(bundle_path, "--photographs", bundle_path / "captures")
    assert done.returncode == 0, done.stderr
    asked = json.loads((tmp_path / "asked.json").read_text())
    assert asked[:2] == ["new", str(bundle_path)]
    assert asked[asked.index("--captures") + 1] == str(bundle_path / "captures" / "images")
    assert asked[asked.index("--poses") + 1] == str(bundle_path / "captures" / "cameras.json")


def test_an_unknown_setting_is_told_in_one_line(run, bundle_path):
    done = run(bundle_path, "--set", "rouns=2")
    assert done.returncode == 1
    assert "Did you mean rounds?" in done.stderr and "Traceback" not in done.stderr

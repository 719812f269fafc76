"""The command that writes the README's table: what it says of scenes it cannot show."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def run(*arguments):
    readme = (ROOT / "README.md").read_bytes()
    command = [sys.executable, "batch/results.py", *map(str, arguments)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert (ROOT / "README.md").read_bytes() == readme
    return done


def test_help_says_what_it_takes():
    done = run("--help")
    assert done.returncode == 0
    assert "r2sego evaluate" in done.stdout


@pytest.mark.parametrize("made", [False, True])
def test_a_scene_without_scores_is_named(tmp_path, made):
    scene = tmp_path / "room.r2s"
    if made:
        subprocess.run(
            [sys.executable, "-m", "r2sego_blender", "new", scene, "--captures", ROOT / "demo/room/captures",
             "--poses", ROOT / "demo/room/cameras.json"], cwd=ROOT, check=True, capture_output=True,
        )  # fmt: skip
    done = run(scene)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert f"{scene}" in done.stderr
    assert ("not evaluated yet" if made else "this is not a scene bundle") in done.stderr

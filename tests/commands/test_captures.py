"""`r2sego register`: ground and scale corrected from a shell."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from wrong_world import assert_true, picked_points, shown_points, wrong_scene, wrong_similarity

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.store import load_captures
from r2sego_blender.commands.cli import main
from r2sego_blender.robot.model.model import EMBEDDED_HUMANOID, RobotModel

ROOT = Path(__file__).parents[2]


def test_the_command_line_corrects_with_the_robots_eye(tmp_path):
    scene, turn, cameras = wrong_scene(tmp_path, wrong_similarity())
    floor = []
    for point in shown_points(turn, cameras):
        floor += [
            "--floor",
            "=".join(f"{photo}:{x!r},{y!r}" for photo, (x, y) in ((p, map(float, xy)) for p, xy in point.views)),
        ]
    command = [
        sys.executable,
        "-m",
        "r2sego_blender",
        "register",
        str(scene.path),
        *floor,
        "--camera-height",
        "robot",
        "--json-progress",
    ]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    robot = RobotModel.load(EMBEDDED_HUMANOID)
    assert told["scale"] == f"robot's eye height of {robot.eye_height_m:.4g} m"
    first = load_captures(scene.captures_folder)[0].camera
    assert first.centre == pytest.approx([0, 0, robot.eye_height_m], abs=1e-6)
    failed = subprocess.run([*command[:5], "--up", "north"], capture_output=True, text=True, cwd=ROOT)
    assert failed.returncode == 1 and "'north' is not X,Y,Z" in failed.stderr


def test_the_command_line_takes_picks_a_frame_and_an_undo(tmp_path):
    scene, turn, cameras = wrong_scene(tmp_path, wrong_similarity(1, scale=2.0))
    file = tmp_path / "picks.json"
    file.write_text(json.dumps(picked_points(turn, cameras).to_json()))

    def register(*options):
        command = ["register", str(scene.path), *options]
        return CliRunner().invoke(main, command)

    command = [sys.executable, "-m", "r2sego_blender", "register", str(scene.path), "--picks", str(file)]
    done = subprocess.run([*command, "--json-progress"], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["residuals"]["lengths"][0]["error_m"] == pytest.approx(0.0, abs=1e-6)
    assert_true(Scene.open(scene.path), cameras)
    assert register("--frame", "1,0,0,0.5,0,1,0,0,0,0,1,0").exit_code == 0
    moved = load_captures(scene.captures_folder)[0].camera.centre
    np.testing.assert_allclose(moved, cameras[0].centre - [0.5, 0, 0], atol=1e-6)
    assert register("--undo").exit_code == 0
    assert_true(Scene.open(scene.path), cameras)
    for wrong, said in (
        (["--undo", "--floor-at", "1"], "in two ways"),
        (["--frame", "1,2"], "not 12 numbers"),
        (["--picks", str(tmp_path / "none.json")], "cannot be read"),
    ):
        refused = register(*wrong)
        assert refused.exit_code == 1 and said in refused.output

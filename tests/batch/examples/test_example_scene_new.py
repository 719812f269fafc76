"""A bundle made from photographs by a script, with pip bpy and the real engine."""

import json
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from example_runs import run_with_engine

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.commands.cli import main

pytest.importorskip("bpy", reason="pip bpy is not installed")

ROOT = Path(__file__).parents[3]
ROOM = ROOT / "demo" / "room"
run = partial(run_with_engine, "scene_new.py")


@pytest.fixture
def photographs(tmp_path):
    """Three photographs of the demo room."""
    folder = tmp_path / "photographs"
    folder.mkdir()
    for file in sorted((ROOM / "captures").glob("*.png"))[:3]:
        shutil.copy(file, folder)
    return folder


def test_what_the_engine_refuses_is_told_in_one_line(blender_environment, photographs, tmp_path):
    done = run(blender_environment, tmp_path / "a.r2s", "--captures", photographs, "--known-length", "a:1:2")
    assert done.returncode == 1
    assert "a:1:2" in done.stderr and "Traceback" not in done.stderr
    assert not (tmp_path / "a.r2s").exists()


def test_the_depth_maps_that_are_chosen_are_looked_for(blender_environment, photographs, tmp_path):
    depth = tmp_path / "nowhere"
    done = run(blender_environment, tmp_path / "a.r2s", "--captures", photographs, "--depth", depth)
    assert done.returncode == 1 and f"{depth}: there is no such folder" in done.stderr


@pytest.mark.parametrize(
    ("option", "metres"),
    [("--camera-height", -2), ("--camera-height", 0), ("--camera-height", 150), ("--marker-side", 15)],
)
def test_a_length_that_blender_would_move_into_its_range_is_refused(
    blender_environment, photographs, tmp_path, option, metres
):
    done = run(blender_environment, tmp_path / "a.r2s", "--captures", photographs, option, metres)
    assert done.returncode == 1
    assert f"{option[2:].replace('-', '_')} is {metres}" in done.stderr and "Traceback" not in done.stderr
    assert not (tmp_path / "a.r2s").exists()


@pytest.mark.slow
def test_a_bundle_is_made_as_the_command_does(blender_environment, photographs, tmp_path):
    poses = json.loads((ROOM / "cameras.json").read_text())
    poses["captures"] = poses["captures"][:3]
    given = tmp_path / "cameras.json"
    given.write_text(json.dumps(poses))
    choices = ["--captures", photographs, "--poses", given, "--robot", "embedded:wheeled"]
    done = run(blender_environment, tmp_path / "room.r2s", *choices)
    assert done.returncode == 0, done.stderr + done.stdout
    assert "robot, Robot: embedded:wheeled" in done.stdout and "captures, Photos: 3" in done.stdout
    said = CliRunner().invoke(main, ["new", str(tmp_path / "same.r2s"), *map(str, choices)])
    assert said.exit_code == 0, said.output
    made, expected = (Scene.open(tmp_path / name) for name in ("room.r2s", "same.r2s"))
    assert made.declaration == expected.declaration
    files = sorted(file.relative_to(expected.path) for file in expected.captures_folder.rglob("*.*"))
    assert sorted(file.relative_to(made.path) for file in made.captures_folder.rglob("*.*")) == files
    for file in files:
        ours, theirs = made.path / file, expected.path / file
        if file.suffix == ".npz":  # the archive has the time it was written
            with np.load(ours) as one, np.load(theirs) as other:
                assert {name: one[name].tobytes() for name in one} == {name: other[name].tobytes() for name in other}
        else:
            assert ours.read_bytes() == theirs.read_bytes(), file

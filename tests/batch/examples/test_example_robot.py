"""The example of the room Robot, with pip bpy and the real engine."""

from functools import partial

import pytest
from example_runs import run_example

pytest.importorskip("bpy", reason="pip bpy is not installed")

from made_up_room import made_up_bundle

from r2sego_blender.robot.scope.scope import BehaviourScope

run = partial(run_example, "robot_rollouts.py")


def test_a_robot_is_declared_tried_and_played(blender_environment, tmp_path):
    scene = made_up_bundle(tmp_path / "room.r2s")
    done = run(
        blender_environment,
        scene.path,
        "--robot",
        "wheeled",
        "--pitch",
        "20,40",
        "--weights",
        "0,1",
        "--region",
        "-1,-1 1,-1 1,1 -1,1",
        "--clearance",
        0.06,
        "--try",
        2,
        "--blend",
        tmp_path / "room.blend",
    )
    assert done.returncode == 0, done.stderr
    assert "Region: polygon, 4.00 m²" in done.stdout
    assert "Pitch: 20° to 40° down, drawn" in done.stdout
    assert "Behaviours: look_around 1" in done.stdout
    assert "2 wheels" in done.stdout
    assert BehaviourScope.load(scene.path / "robot" / "scope.toml").region.clearance_m == 0.06
    assert "attempt 1: look_around, " in done.stdout
    assert "follow frames 0 to 40" in done.stdout
    assert (tmp_path / "room.blend").is_file()


def test_a_failure_of_a_round_is_jumped_to(blender_environment, bundle_path):
    done = run(blender_environment, bundle_path, "--robot", "wheeled", "--attempt", 1)
    assert done.returncode == 0, done.stderr
    assert "attempt 1: walk_to, body_contact, mast touched the chair, 5 frames, 0.8 s" in done.stdout
    assert "follow frames 0 to 4, now at 4" in done.stdout


def test_what_the_engine_refuses_is_said(blender_environment, bundle_path):
    done = run(blender_environment, bundle_path, "--region", "0,0 1,1 1,0 0,1")
    assert done.returncode == 1
    assert "crosses itself" in done.stderr

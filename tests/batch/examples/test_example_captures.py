"""The example of the room Captures, with pip bpy and the real engine."""

import json
from functools import partial

import numpy as np
import pytest
from example_runs import run_example
from picked_points import picked_points

from r2sego_blender.captures.store import load_captures

pytest.importorskip("bpy", reason="pip bpy is not installed")

run = partial(run_example, "captures_registration.py")
SPOTS = {"A": (-0.4, 0.2, 0.1), "B": (0.5, 0.1, 0.1), "C": (0.1, 0.7, 0.1)}


@pytest.fixture
def picks(tmp_path):
    """SPOTS, 0.1 m above the world's floor, picked wherever they are seen; A to B is measured double."""
    points = picked_points(SPOTS)
    length = 2.0 * float(np.linalg.norm(np.subtract(SPOTS["A"], SPOTS["B"])))
    file = tmp_path / "picks.json"
    file.write_text(json.dumps({"points": points, "lengths": [{"from": "A", "to": "B", "metres": length}]}))
    return file


def test_picks_are_told_applied_and_taken_back(bundle_path, blender_environment, picks, tmp_path):
    before = load_captures(bundle_path / "captures")
    done = run(blender_environment, bundle_path, "--picks", picks, "--correct", "--to", tmp_path / "a.blend")
    assert done.returncode == 0, done.stderr
    assert "capture_0: 64x48, 65.2 degrees wide, 50 points, overlaps 2" in done.stdout
    assert "A: 0.00 px off, " in done.stdout and "a metre becomes 2 m" in done.stdout
    assert "after: A to B: 1.811 m, " in done.stdout and "1 corrections" in done.stdout
    after = load_captures(bundle_path / "captures")
    for old, new in zip(before, after, strict=True):
        assert new.camera.centre[2] == pytest.approx(2.0 * (old.camera.centre[2] - 0.1), abs=1e-4)
    assert f"capture_0 stands at (0.0, 0.0, {after[0].camera.centre[2]:.4g}" in done.stdout.replace("-0.0", "0.0")
    done = run(blender_environment, bundle_path, "--undo")
    assert done.returncode == 0, done.stderr
    assert "0 corrections" in done.stdout
    for old, new in zip(before, load_captures(bundle_path / "captures"), strict=True):
        np.testing.assert_allclose(new.camera.world_from_camera, old.camera.world_from_camera, atol=1e-6)


def test_a_placed_frame_becomes_the_world(bundle_path, blender_environment):
    before = load_captures(bundle_path / "captures")[0].camera.centre
    done = run(blender_environment, bundle_path, "--frame", 0.5, 0.25, 0.1, 90)
    assert done.returncode == 0, done.stderr
    after = load_captures(bundle_path / "captures")[0].camera.centre
    expected = [before[1] - 0.25, -(before[0] - 0.5), before[2] - 0.1]
    np.testing.assert_allclose(after, expected, atol=1e-5)


def test_what_cannot_be_is_told_in_one_line(bundle_path, blender_environment):
    done = run(blender_environment, bundle_path, "--undo")
    assert done.returncode == 1
    assert "no correction to take back" in done.stderr and "Traceback" not in done.stderr


@pytest.mark.parametrize("metres", [1811.0, -1.0])
def test_a_measure_that_blender_would_move_into_its_range_is_refused(bundle_path, blender_environment, picks, metres):
    """As in millimetres."""
    told = json.loads(picks.read_text())
    told["lengths"][0]["metres"] = metres
    picks.write_text(json.dumps(told))
    before = (bundle_path / "scene.toml").read_text()
    done = run(blender_environment, bundle_path, "--picks", picks, "--correct")
    assert done.returncode == 1 and "Traceback" not in done.stderr
    assert (bundle_path / "scene.toml").read_text() == before

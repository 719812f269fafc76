"""Picks left out of a registration by a script, with pip bpy and the real engine."""

import json
import shutil
import subprocess
import sys
from functools import partial

import fake_bundle
import numpy as np
import pytest
from click.testing import CliRunner
from example_runs import run_with_engine
from picked_points import picked_points

from r2sego_blender.captures.store import load_captures
from r2sego_blender.commands.cli import main

pytest.importorskip("bpy", reason="pip bpy is not installed")

run = partial(run_with_engine, "captures_picks.py")
SPOTS = {"A": (-0.4, 0.2, 0.1), "B": (0.5, 0.1, 0.1), "C": (0.1, 0.7, 0.1), "D": (-0.3, 0.9, 0.1)}


@pytest.fixture
def picks():
    """SPOTS, 0.1 m above the world's floor; the first pick of C is 6 px off, and A to C 5 cm too long."""
    points = picked_points(SPOTS)
    points[2]["views"][0]["x_px"] += 6.0
    far = {ends: float(np.linalg.norm(np.subtract(*(SPOTS[end] for end in ends)))) for ends in ("AB", "AD")}
    lengths = [{"from": "A", "to": "B", "metres": far["AB"]}, {"from": "A", "to": "D", "metres": far["AD"] + 0.05}]
    return {"points": points, "lengths": lengths}


def test_the_wrong_pick_stands_out_and_the_rest_corrects_as_the_command_does(
    bundle_path, blender_environment, picks, tmp_path
):
    same = shutil.copytree(bundle_path, tmp_path / "same.r2s")
    file, rest, blend = (tmp_path / name for name in ("picks.json", "rest.json", "worst.blend"))
    file.write_text(json.dumps(picks))
    done = run(
        blender_environment,
        bundle_path,
        "--picks",
        file,
        "--without",
        "C",
        "--without",
        "A-D",
        "--correct",
        "--to",
        blend,
    )
    assert done.returncode == 0, done.stderr + done.stdout
    told = dict(line.split(": ", 1) for line in done.stdout.splitlines() if line.startswith("without "))
    assert list(told) == [f"without {one}" for one in ("A", "B", "C", "D", "A-B", "A-D")]
    assert [one for one in told if "one point 'C'" not in told[one]] == ["without C"]
    assert told["without C"].startswith("0.00 px, 0.0 cm off the floor, ")
    assert "A to B: 0.906 m, +0.0 cm" in done.stdout and "A to D: 0.757 m, " not in done.stdout
    assert "the worst pick is that of " in done.stdout
    picks["points"] = [point for point in picks["points"] if point["name"] != "C"]
    picks["lengths"] = picks["lengths"][:1]
    rest.write_text(json.dumps(picks))
    said = CliRunner().invoke(main, ["register", str(same), "--picks", str(rest)])
    assert said.exit_code == 0, said.output
    for ours, theirs in zip(*(load_captures(one / "captures") for one in (bundle_path, same)), strict=True):
        # Blender's properties hold 32-bit floats.
        np.testing.assert_allclose(ours.camera.world_from_camera, theirs.camera.world_from_camera, atol=1e-4)
    look = (
        f"import bpy; bpy.ops.wm.open_mainfile(filepath={str(blend)!r}); scene = bpy.context.scene; "
        "print(scene.camera.name, scene.render.resolution_x, scene.render.resolution_y)"
    )
    opened = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True)
    capture = done.stdout.partition("the worst pick is that of ")[2].split()[2].rstrip(",")
    lens = fake_bundle.cameras()[int(capture[-1])]
    assert f"{capture} {lens.width} {lens.height}" in opened.stdout, opened.stderr


def test_a_pick_in_one_capture_is_left_out(bundle_path, blender_environment, picks, tmp_path):
    file = tmp_path / "picks.json"
    file.write_text(json.dumps(picks))
    wrong = picks["points"][2]["views"][0]["capture"]
    done = run(blender_environment, bundle_path, "--picks", file, "--without", f"C:{wrong}")
    assert done.returncode == 0, done.stderr + done.stdout
    assert "C: 0.00 px off" in done.stdout
    done = run(blender_environment, bundle_path, "--picks", file, "--without", "Z")
    assert done.returncode == 1
    assert "'Z' is no point and no length" in done.stderr and "Traceback" not in done.stderr


def test_the_only_point_is_left_out_and_picked_again(bundle_path, blender_environment, picks, tmp_path):
    file = tmp_path / "picks.json"
    file.write_text(json.dumps({"points": picks["points"][:1]}))
    done = run(blender_environment, bundle_path, "--picks", file)
    assert done.returncode == 0, done.stderr + done.stdout
    assert "without A: 0.00 px" in done.stdout and "the worst pick is that of A in " in done.stdout
    done = run(blender_environment, bundle_path, "--picks", file, "--without", "A")
    assert done.returncode == 0, done.stderr + done.stdout
    assert "the worst pick" not in done.stdout

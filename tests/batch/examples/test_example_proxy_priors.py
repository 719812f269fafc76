"""Priors placed, given a mesh and decided on by a script, with pip bpy and the real engine."""

import json
import shutil
from functools import partial

import fake_proxy
import numpy as np
import pytest
from click.testing import CliRunner
from example_runs import run_with_engine

from r2sego_blender.commands.cli import main
from r2sego_blender.geometry.objects.shapes import load_shape

pytest.importorskip("bpy", reason="pip bpy is not installed")

run = partial(run_with_engine, "proxy_priors.py")


def r2sego(*arguments):
    done = CliRunner().invoke(main, [*map(str, arguments)])
    assert done.exit_code == 0, done.output


@pytest.fixture
def crate_file(tmp_path):
    """The crate as an OBJ, in its own frame."""
    vertices, faces = fake_proxy.crate()
    lines = [f"v {x} {y} {z}" for x, y, z in vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in faces + 1]
    file = tmp_path / "crate.obj"
    file.write_text("\n".join(lines) + "\n")
    return file


def test_what_the_script_says_of_priors_is_what_the_command_writes(
    bundle_path, blender_environment, crate_file, tmp_path
):
    r2sego("objects", bundle_path, "--mesh", f"crate={crate_file}")
    same = shutil.copytree(bundle_path, tmp_path / "same.r2s")
    done = run(
        blender_environment,
        bundle_path,
        "--move",
        "crate=0.3,0,-0.125",
        "--start",
        "--mesh",
        f"lamp={crate_file}",
        "--place",
        "lock",
        "--decide",
        "lamp=accept",
    )
    assert done.returncode == 0, done.stderr + done.stdout
    assert "crate: placed, its own mesh, 3 masks" in done.stdout or "crate: aligned, " in done.stdout
    assert "lamp: locked, its own mesh, 3 masks; it overlaps too little" in done.stdout
    (told,) = [line for line in done.stdout.splitlines() if line.startswith("crate: overlap ")]
    before, after = float(told.split()[2]), float(told.split()[4])
    assert before > 0.9 and after < 0.8

    moved = fake_proxy.CRATE_FROM_OWN.copy()
    moved[:3, 3] += (0.3, 0.0, -0.125)
    placements = {"crate": (moved, False), "lamp": (np.eye(4), True)}
    for name, (pose, locked) in placements.items():
        file = tmp_path / f"{name}.json"
        file.write_text(json.dumps({"world_from_own": pose.tolist(), "locked": locked}))
    r2sego("objects", same, "--place", f"crate={tmp_path / 'crate.json'}")
    r2sego(
        "objects", same, "--mesh", f"lamp={crate_file}", "--place", f"lamp={tmp_path / 'lamp.json'}", "--accept", "lamp"
    )
    made, expected = bundle_path / "objects", same / "objects"
    files = sorted(str(file.relative_to(expected)) for file in expected.rglob("*.*"))
    assert sorted(str(file.relative_to(made)) for file in made.rglob("*.*")) == files
    for file in files:
        if file.endswith("placement.json"):
            ours, theirs = (json.loads((folder / file).read_text()) for folder in (made, expected))
            assert ours["locked"] == theirs["locked"]
            np.testing.assert_allclose(ours["world_from_own"], theirs["world_from_own"], atol=1e-6)
        elif file == "lamp/mesh.obj":
            ours, theirs = (load_shape(folder / file) for folder in (made, expected))
            np.testing.assert_allclose(ours.vertices, theirs.vertices, atol=1e-6)
            np.testing.assert_array_equal(ours.faces, theirs.faces)
        else:
            assert (made / file).read_bytes() == (expected / file).read_bytes(), file


def test_an_object_that_is_not_there_is_told_in_one_line(bundle_path, blender_environment):
    done = run(blender_environment, bundle_path, "--decide", "sofa=accept")
    assert done.returncode == 1
    assert "There is no object 'sofa'" in done.stderr and "Traceback" not in done.stderr

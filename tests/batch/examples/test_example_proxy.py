"""The example of the room Proxy, with pip bpy and the real engine."""

from functools import partial

import pytest
from example_runs import run_with_engine

pytest.importorskip("bpy", reason="pip bpy is not installed")

run = partial(run_with_engine, "proxy_edits.py")


def test_the_proxy_is_coloured_edited_and_planned(bundle_path, blender_environment):
    mask = "capture_1:10,10 40,10 40,40"
    done = run(blender_environment, bundle_path, "--cut-box", "0,0.6,0.6:1", "--mask", mask, "--keep")
    assert done.returncode == 0, done.stderr + done.stdout
    assert "Provenance: Observed by captures " in done.stdout
    assert "Support Gap: Robot sees, no capture 0.0 m2, " in done.stdout
    assert "crate: aligned, overlap 0.9" in done.stdout and "lamp: refused, overlap 0.9" in done.stdout
    assert "drew on capture_1: 1 mask" in done.stdout
    assert "edit example_cut: cut away, 1 faces" in done.stdout
    assert "edit example_shelf: drawn, " in done.stdout
    assert "Refine redoes stereo, " in done.stdout
    names = {file.stem for file in (bundle_path / "geometry" / "edits").iterdir()}
    assert names == {"hole", "example_cut", "example_shelf"}
    assert (bundle_path / "objects" / "example" / "masks" / "capture_1.png").is_file()
    assert (bundle_path / "objects" / "crate" / "masks" / "capture_0.png").is_file()


def test_what_is_not_kept_is_taken_back(bundle_path, blender_environment):
    done = run(blender_environment, bundle_path)
    assert done.returncode == 0, done.stderr + done.stdout
    assert [file.name for file in (bundle_path / "geometry" / "edits").iterdir()] == ["hole.npz"]
    done = run(blender_environment, bundle_path, "--mask", "attic:1,1 2,2 3,1")
    assert done.returncode == 1
    assert "There is no capture 'attic'" in done.stderr and "Traceback" not in done.stderr

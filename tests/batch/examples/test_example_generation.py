"""The example of the room Generation, with pip bpy."""

from functools import partial

import fake_bundle
import numpy as np
import pytest
from example_runs import run_example

from r2sego_blender.generation.conditions.blender_conditions import read_condition
from r2sego_blender.generation.conditions.conditions import ZBufferRenderer
from r2sego_blender.results.panels.bundle import Bundle

pytest.importorskip("bpy", reason="pip bpy is not installed")

run = partial(run_example, "generation_views.py")


def test_views_are_decided_on_listed_and_pictured(bundle_path, blender_environment, tmp_path):
    done = run(blender_environment, bundle_path, "--to", tmp_path / "out", "--round", 0, "--reject", 2)
    assert done.returncode == 0, done.stderr
    assert (bundle_path / "rounds" / "0" / "views" / "002" / "decision.json").is_file()
    assert "view 2: rejected, rejected by hand (by its figures: registered" in done.stdout
    assert "view 3: accepted" in done.stdout and "stands in for view 1" in done.stdout
    names = sorted(file.name for file in (tmp_path / "out").iterdir())
    assert names == ["000.png", "002.png", "003.png", "view.blend"]


def test_conditions_of_a_clip_are_rendered_as_the_z_buffer_has_them(bundle_path, blender_environment, tmp_path):
    pytest.importorskip("OpenEXR", reason="OpenEXR is not installed")
    done = run(blender_environment, bundle_path, "--to", tmp_path / "out", "--conditions", 50)
    assert done.returncode == 0, done.stderr
    folder, bundle = tmp_path / "out" / "conditions", Bundle.open(bundle_path)
    assert f"{folder}: {fake_bundle.PATH_FRAMES} frames" in done.stdout
    expected = ZBufferRenderer(bundle.proxy(1))
    for index, camera in enumerate(bundle.camera_path(1, 0)):
        seen = expected.condition(camera.scaled(0.5))
        found = read_condition(folder / f"{index:03d}.exr", seen.camera)
        for name in ("provenance", "instance"):
            assert (getattr(found, name) == getattr(seen, name)).mean() > 0.98, name
        surface = (found.depth > 0) & (seen.depth > 0)
        near = np.abs(found.depth - seen.depth)[surface] <= 1e-3 * (1.0 + seen.depth[surface])
        assert near.mean() > 0.98


def test_what_cannot_be_is_told_in_one_line(bundle_path, blender_environment, tmp_path):
    done = run(blender_environment, bundle_path, "--to", tmp_path / "out", "--accept", 1)
    assert done.returncode == 1
    assert "no estimated pose" in done.stderr and "Traceback" not in done.stderr

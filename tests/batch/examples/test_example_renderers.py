"""The scripts that render a round's conditions and compare the renderers, with pip bpy."""

import json
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import fake_bundle
import numpy as np
import pytest

from r2sego_blender.generation.conditions.blender_conditions import read_condition
from r2sego_blender.generation.conditions.conditions import ZBufferRenderer
from r2sego_blender.results.panels.bundle import Bundle

pytest.importorskip("bpy", reason="pip bpy is not installed")
pytest.importorskip("OpenEXR", reason="OpenEXR is not installed")

EXAMPLES = Path(__file__).parents[3] / "batch" / "examples"


def run(environment, script, *arguments):
    return subprocess.run(
        [sys.executable, str(EXAMPLES / script), *map(str, arguments)],
        env=environment,
        capture_output=True,
        text=True,
        timeout=1200,
    )


def test_a_round_s_conditions_are_rendered_as_the_z_buffer_has_them(bundle_path, blender_environment, tmp_path):
    out = tmp_path / "out"
    done = run(
        blender_environment, "render_conditions.py", "--", bundle_path, "--to", out, "--round", 0, "--scale", 0.5
    )
    assert done.returncode == 0, done.stderr
    assert f"view 0: {fake_bundle.PATH_FRAMES} frames in {out / '000'}" in done.stdout
    assert json.loads((out / "000" / "manifest.json").read_text())["complete"]
    bundle = Bundle.open(bundle_path)
    expected = ZBufferRenderer(bundle.proxy(0))
    for index, camera in enumerate(bundle.camera_path(0, 0)):
        seen = expected.condition(camera.scaled(0.5))
        found = read_condition(out / "000" / f"{index:03d}.exr", seen.camera)
        assert (found.provenance == seen.provenance).mean() > 0.98
        surface = (found.depth > 0) & (seen.depth > 0)
        near = np.abs(found.depth - seen.depth)[surface] <= 1e-3 * (1.0 + seen.depth[surface])
        assert near.mean() > 0.98


def test_two_that_share_a_round_s_frames_render_each_once(bundle_path, blender_environment, tmp_path):
    out = tmp_path / "out"
    asked = ("--", bundle_path, "--to", out, "--round", 0, "--scale", 0.25, "--share")
    with ThreadPoolExecutor(2) as pool:
        both = [pool.submit(run, blender_environment, "render_conditions.py", *asked) for _ in range(2)]
        done = [one.result() for one in both]
    assert [one.returncode for one in done] == [0, 0], done[0].stderr + done[1].stderr
    shares = [int(re.search(r"view 0: (\d+) frames", one.stdout)[1]) for one in done]
    assert sum(shares) == fake_bundle.PATH_FRAMES
    assert len(json.loads((out / "000" / "manifest.json").read_text())["frames"]) == fake_bundle.PATH_FRAMES


def test_renderers_are_compared_frame_by_frame(bundle_path, blender_environment):
    done = run(blender_environment, "compare_renderers.py", bundle_path, "--size", 64, 48, "--captures", 1)
    assert done.returncode == 0, done.stderr
    assert "13 faces" in done.stdout.splitlines()[0]
    rows = [line.split() for line in done.stdout.splitlines()[2:]]
    assert [row[0] for row in rows] == ["64", "64", "48", "worst"]
    worst = [float(number) for number in rows[-1][1:]]
    assert len(worst) == 5 and min(worst) > 95.0
    assert worst == [min(column) for column in zip(*([*map(float, row[3:8])] for row in rows[:-1]), strict=True)]

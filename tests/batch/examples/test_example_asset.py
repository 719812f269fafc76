"""The example of the room Asset, with pip bpy and the real engine."""

import subprocess
import sys
from pathlib import Path

import fake_asset
import numpy as np
import pytest

from r2sego_blender.core.images import load_image_uint8, to_uint8
from r2sego_blender.splats.asset_edits import load_edits
from r2sego_blender.splats.formats.ply import load_ply
from r2sego_blender.splats.formats.registry import load_asset
from r2sego_blender.splats.rendering.rasterizer import render

pytest.importorskip("bpy", reason="pip bpy is not installed")

SCRIPT = Path(__file__).parents[3] / "batch" / "examples" / "asset_cleaning.py"


@pytest.fixture
def run(blender_environment, bundle_path, tmp_path):
    """Run the script on the bundle with this Python as the engine."""

    def run(*arguments):
        return subprocess.run(
            [sys.executable, str(SCRIPT), "--", str(bundle_path), "--to", str(tmp_path / "out"), *arguments],
            env={**blender_environment, "R2SEGO_PYTHON": sys.executable},
            capture_output=True,
            text=True,
            timeout=1200,
        )

    return run


def test_a_box_is_deleted_rendered_written_and_restored(run, bundle_path, tmp_path):
    from fake_bundle import cameras

    before = load_ply(bundle_path / "asset.ply")
    done = run("--delete", "-0.5", "-0.5", "0.2", "0.5", "0.5", "2", "--name", "floaters", "--format", ".glb")
    assert done.returncode == 0, done.stderr
    gone = (np.abs(before.means - (0.0, 0.0, 1.1)) <= (0.5, 0.5, 0.9)).all(axis=1)
    left = load_ply(bundle_path / "asset.ply")
    assert gone.sum() > 0 and f"deleting {gone.sum()} splats" in done.stdout
    np.testing.assert_array_equal(left.means, before.means[~gone])
    np.testing.assert_array_equal(left.sh, before.sh[~gone])
    assert len(load_asset(tmp_path / "out" / "asset.glb")) == len(left)
    picture = load_image_uint8(tmp_path / "out" / "asset.png")
    expected = to_uint8(render(left, cameras()[0]).colour)
    # The lens has gone through Blender's 32-bit floats.
    assert picture.shape == expected.shape
    assert np.abs(picture.astype(int) - expected).max() <= 1
    done = run("--restore", "floaters")
    assert done.returncode == 0, done.stderr
    assert (load_ply(bundle_path / "asset.ply").means == before.means).all()
    assert load_edits(bundle_path / "asset_edits") == ()


@pytest.mark.parametrize("wrong", ["format", "folder"])
def test_nothing_is_deleted_where_the_asset_could_not_be_written_then(run, bundle_path, tmp_path, wrong):
    before = (bundle_path / "asset.ply").read_bytes()
    if wrong == "folder":
        (tmp_path / "out").write_text("a file")
    done = run("--delete", "-0.5", "-0.5", "0.2", "0.5", "0.5", "2", *(["--format", ".xyz"] * (wrong == "format")))
    assert done.returncode != 0 and "Traceback" not in done.stderr
    assert (bundle_path / "asset.ply").read_bytes() == before


def test_a_round_is_shown_with_a_lasso_and_a_selection(run, bundle_path):
    done = run("--round", "0", "--lasso", "1.8", "--fainter", "0.35", "--format", ".ply")
    assert done.returncode == 0, done.stderr
    assert f"Round 0: {fake_asset.SPLATS} splats" in done.stdout and "deleted in edit_001" in done.stdout
    assert len(load_edits(bundle_path / "asset_edits")) == 1

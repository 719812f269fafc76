"""Floaters and boxes marked and deleted by a script, with pip bpy and the real engine."""

import json
import shutil
from functools import partial

import fake_asset
import numpy as np
import pytest
from click.testing import CliRunner
from example_runs import run_with_engine

from r2sego_blender.commands.cli import main
from r2sego_blender.splats.asset_edits import load_edits
from r2sego_blender.splats.floaters import neighbours
from r2sego_blender.splats.formats.ply import load_ply
from r2sego_blender.splats.regions import Box, Cells

pytest.importorskip("bpy", reason="pip bpy is not installed")

run = partial(run_with_engine, "asset_marks.py")
BOX = (0.2, -0.1, 1.0, 0.5, 0.6, 0.4)


def test_what_is_marked_is_deleted_as_the_command_does(bundle_path, blender_environment, tmp_path):
    same = shutil.copytree(bundle_path, tmp_path / "same.r2s")
    before = load_ply(bundle_path / "asset.ply")
    means = before.means.astype(np.float64)
    room = np.arange(len(means)) < len(means) - fake_asset.BACKDROP_SPLATS
    few = {fewest: neighbours(means[room], 0.3) < fewest for fewest in (2, 3, 5, 10)}
    floating = np.zeros(len(means), bool)
    floating[room] = few[3]
    floating |= room & (1.0 / (1.0 + np.exp(-before.logit_opacities)) < 0.4)
    box = Box(np.block([[np.eye(3), np.array([BOX[:3]]).T], [0.0, 0.0, 0.0, 1.0]]), np.array(BOX[3:]))
    regions = {"cells": Cells.around(means[floating], 0.005), "box": box}
    gone = regions["cells"].holds(means) | box.holds(means)
    assert 0 < floating.sum() < gone.sum() < room.sum()

    done = run(
        blender_environment,
        bundle_path,
        "--distance",
        0.3,
        "--fewest",
        3,
        "--faint",
        0.4,
        "--box",
        *BOX,
        "--delete",
        "floaters",
    )
    assert done.returncode == 0, done.stderr + done.stdout
    for fewest in (2, 5, 10):
        assert f"{few[fewest].sum()} splats have fewer than {fewest} within 0.3 m" in done.stdout
    assert f"{floating.sum()} floaters are marked" in done.stdout
    assert f"{gone.sum()} splats are marked in 2 regions" in done.stdout
    assert "deleted in floaters: " in done.stdout
    np.testing.assert_array_equal(load_ply(bundle_path / "asset.ply").means, before.means[~gone])

    command = ["edit-asset", str(same), "--name", "floaters"]
    for kind, region in regions.items():
        (tmp_path / f"{kind}.json").write_text(json.dumps(region.to_json()))
        command += [f"--{kind}", str(tmp_path / f"{kind}.json")]
    said = CliRunner().invoke(main, command)
    assert said.exit_code == 0, said.output
    assert (bundle_path / "asset.ply").read_bytes() == (same / "asset.ply").read_bytes()


def test_without_a_name_it_only_counts(bundle_path, blender_environment):
    done = run(blender_environment, bundle_path, "--round", 0, "--distance", 0.3)
    assert done.returncode == 0, done.stderr + done.stdout
    assert "0 splats are marked in 0 regions" in done.stdout
    assert load_edits(bundle_path / "asset_edits") == ()

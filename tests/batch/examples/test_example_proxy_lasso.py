"""The proxy cut through a capture by a script, with pip bpy and the real engine."""

import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import fake_bundle
import numpy as np
import pytest
from click.testing import CliRunner

from r2sego_blender.commands.cli import main

pytest.importorskip("bpy", reason="pip bpy is not installed")

SCRIPT = Path(__file__).parents[3] / "batch" / "examples" / "proxy_lasso.py"
LASSOS = {1: "20,5 70,5 70,40 20,40", 2: "30,40 40,40 38,60 28,58"}
FARTHEST_M = 3.3


def inside(capture: int, text: str) -> set[int]:
    """The faces of round 0 whose middle a capture's camera shows inside the polygon, by another library."""
    proxy, camera = fake_bundle.proxy(0), fake_bundle.cameras()[capture]
    polygon = np.array([pair.split(",") for pair in text.split()], np.float32)
    pixels, depth = camera.project(proxy.vertices[proxy.faces].mean(axis=1))
    near = (depth > 0.0) & (depth <= FARTHEST_M)
    return {
        face
        for face in np.flatnonzero(near).tolist()
        if cv2.pointPolygonTest(polygon, tuple(map(float, pixels[face])), False) > 0
    }


def test_what_lies_in_the_lassos_is_cut_as_the_command_does(bundle_path, blender_environment, tmp_path):
    same = shutil.copytree(bundle_path, tmp_path / "same.r2s")
    faces = sorted(set().union(*(inside(capture, text) for capture, text in LASSOS.items())))
    assert faces == [2, 8, 12]
    lassos = [part for k, text in LASSOS.items() for part in ("--lasso", f"capture_{k}:{text}")]
    done = subprocess.run(
        [
            sys.executable,
            str(SCRIPT),
            "--",
            str(bundle_path),
            "--round",
            "0",
            *lassos,
            "--behind",
            "--farthest",
            str(FARTHEST_M),
            "--name",
            "window",
        ],
        env={**blender_environment, "R2SEGO_PYTHON": sys.executable},
        capture_output=True,
        text=True,
        timeout=1200,
    )
    assert done.returncode == 0, done.stderr + done.stdout
    assert "3 of 13 faces are selected" in done.stdout and "edit window: cut away, 3 faces" in done.stdout
    proxy = fake_bundle.proxy(0)
    cut = tmp_path / "window.npz"
    np.savez(cut, corners=proxy.vertices[proxy.faces[faces]], round=np.int64(0))
    said = CliRunner().invoke(main, ["edit-proxy", str(same), "--cut", str(cut)])
    assert said.exit_code == 0, said.output
    edits = [np.load(one / "geometry" / "edits" / "window.npz") for one in (bundle_path, same)]
    assert set(edits[0].files) == set(edits[1].files) and edits[0].files
    for name in edits[0].files:
        np.testing.assert_array_equal(edits[0][name], edits[1][name])


def test_what_faces_the_capture_is_selected_and_nothing_is_kept_without_a_name(bundle_path, blender_environment):
    done = subprocess.run(
        [sys.executable, str(SCRIPT), "--", str(bundle_path), "--round", "0", "--lasso", f"capture_1:{LASSOS[1]}"],
        env={**blender_environment, "R2SEGO_PYTHON": sys.executable},
        capture_output=True,
        text=True,
        timeout=1200,
    )
    assert done.returncode == 0, done.stderr + done.stdout
    assert "1 of 13 faces are selected" in done.stdout  # the raised triangle alone
    assert [file.name for file in (bundle_path / "geometry" / "edits").iterdir()] == ["hole.npz"]

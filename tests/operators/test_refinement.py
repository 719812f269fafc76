"""Blender's buttons and the real engine together: photographs in, a refined scene out."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.results.status import describe

pytest.importorskip("bpy", reason="pip bpy is not installed")
pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
SCRIPT = Path(__file__).with_name("refine_in_blender.py")


def test_a_room_is_refined_shown_and_exported_from_inside_blender(tmp_path):
    build = [sys.executable, str(ROOT / "batch" / "build_extension.py"), "--out", str(tmp_path)]
    subprocess.run(build, check=True)
    (package,) = tmp_path.glob("*.zip")
    scene, export, out = tmp_path / "room.r2s", tmp_path / "export", tmp_path / "out.json"
    arguments = [package, sys.executable, ROOT / "demo" / "room", scene, export, out]
    done = subprocess.run(
        [sys.executable, str(SCRIPT), "--", *map(str, arguments)],
        env={**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path / "user")},
        capture_output=True,
        text=True,
        timeout=1200,
    )
    assert out.is_file(), done.stdout[-3000:] + done.stderr[-3000:]
    held = json.loads(out.read_text())
    assert held["rounds_done"] == 1
    assert held["cameras"] >= 6 + 1  # the captures' and a target's at least
    assert held["faces"] > 1000
    told = describe(Scene.open(scene))
    assert told["refined"]
    assert (export / "asset.ply").is_file() and (export / "collision" / "scene.xml").is_file()

"""The example that makes a scene light to draw, with pip bpy."""

import subprocess
import sys
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy", reason="pip bpy is not installed")

SCRIPT = Path(__file__).parents[3] / "batch" / "examples" / "scene_drawing.py"


def test_fewer_faces_are_drawn_and_all_are_kept(blender_environment, bundle_path, tmp_path):
    blend = tmp_path / "room.blend"
    done = subprocess.run(
        [sys.executable, str(SCRIPT), "--", str(bundle_path), str(blend), "--faces", "6"],
        env=blender_environment,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    (line,) = (line for line in done.stdout.splitlines() if line.endswith("faces are drawn"))
    drawn, kept = (int(word) for word in line.split() if word.isdigit())
    assert 0 < drawn < kept
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    (proxy,) = (one for one in bpy.data.objects if one.name.startswith("Proxy"))
    assert len(proxy.data.polygons) == kept
    assert not any(modifier.show_render for modifier in proxy.modifiers)

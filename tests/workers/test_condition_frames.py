"""The command that renders a clip's conditions for Blender, told in JSON lines."""

import json
import subprocess
import sys

import pytest
from room_meshes import observed_proxy

from r2sego_blender.core.cameras import Camera, look_at

pytest.importorskip("bpy", reason="pip bpy is not installed")
CAMERA = Camera(32, 24, 30.0, 30.0, 16.0, 12.0, look_at((0.0, -2.0, 1.0), (0.0, 0.0, 0.0)))


@pytest.fixture
def scene(tmp_path):
    """A folder with a proxy and two cameras' file."""
    (tmp_path / "proxy").mkdir()
    corners = [[-9, -9, 0], [9, -9, 0], [0, 9, 0]]
    observed_proxy(corners, [[0, 1, 2]]).save(tmp_path / "proxy" / "proxy.npz")
    (tmp_path / "cameras.json").write_text(json.dumps([CAMERA.to_json()] * 2))
    return tmp_path


def told(*arguments):
    """Its exit status and the lines it says."""
    command = [sys.executable, "-m", "r2sego_blender.workers.condition_frames", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    return done.returncode, [json.loads(line) for line in done.stdout.splitlines()]


def test_frames_are_rendered_and_counted(scene):
    out = scene / "new" / "frames"
    status, lines = told(scene, "proxy/proxy.npz", scene / "cameras.json", "--to", out)
    assert status == 0 and lines[-1] == {"event": "result", "frames": 2}
    assert {line["total"] for line in lines[:-1]} == {2} and lines[0]["done"] == 0
    assert {file.name for file in out.iterdir()} == {"000.exr", "001.exr", "manifest.json"}


def test_what_cannot_be_rendered_is_told_in_a_sentence(scene):
    status, lines = told(scene, "proxy/none.npz", scene / "cameras.json", "--to", scene / "out")
    assert status == 1 and lines[-1]["event"] == "error" and "none.npz" in lines[-1]["text"]
    (scene / "file").write_text("in the way")
    status, lines = told(scene, "proxy/proxy.npz", scene / "cameras.json", "--to", scene / "file" / "out")
    assert status == 1 and lines[-1]["event"] == "error" and "file" in lines[-1]["text"]

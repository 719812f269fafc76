"""Exports of Record3D, written from a room whose geometry is known."""

from __future__ import annotations

import json
import shutil

import numpy as np
import OpenEXR
import pytest
from expected_errors import refused
from scipy.spatial.transform import Rotation

from r2sego_blender.captures.importing import import_captures
from r2sego_blender.captures.poses.registry import find_poses
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.errors import CaptureError

SETTINGS = CaptureSettings()
# ARKit's world has +Y up.
ARKIT_FROM_ROOM = np.array([[1.0, 0, 0, 0.3], [0, 0, 1, -1.2], [0, -1, 0, 0.8], [0, 0, 0, 1]])
GL = np.diag([1.0, -1.0, -1.0, 1.0])


@pytest.fixture
def export(tmp_path, room, room_captures):
    """A folder as the app writes it, with frames' own focal lengths, and its metadata."""
    folder = tmp_path / "2026-11-26--10-00-00" / "EXR_RGBD"
    (folder / "rgb").mkdir(parents=True)
    (folder / "depth").mkdir()
    poses, lenses = [], []
    for index, capture in enumerate(room_captures):
        shutil.copy(capture.image_path, folder / "rgb" / f"{index}.png")
        depth = room.depth(capture.camera.scaled(0.64)).astype(np.float32)
        OpenEXR.File({"type": OpenEXR.scanlineimage}, {"R": depth}).write(str(folder / "depth" / f"{index}.exr"))
        pose = ARKIT_FROM_ROOM @ capture.camera.world_from_camera @ GL
        poses.append([*Rotation.from_matrix(pose[:3, :3]).as_quat().tolist(), *pose[:3, 3].tolist()])
        camera = capture.camera
        lenses.append([camera.fx, camera.fy, camera.cx, camera.cy])
    data = {"w": 400, "h": 300, "fps": 60, "K": [290.0, 0, 0, 0, 290.0, 0, 200.0, 150.0, 1], "poses": poses}
    (folder / "metadata.json").write_text(json.dumps({**data, "perFrameIntrinsicCoeffs": lenses}))
    return folder, data


@pytest.mark.parametrize("place", [".", "..", "metadata.json"])
def test_cameras_and_depth_are_those_of_the_room(export, room, room_cameras, place):
    folder, _ = export
    if place == "metadata.json":
        imported = import_captures(folder / "rgb", folder / place, SETTINGS)
    else:
        imported = import_captures((folder / place).resolve(), None, SETTINGS)
    assert imported.metric and len(imported.captures) == len(room_cameras)
    for capture, camera in zip(imported.captures, room_cameras, strict=True):
        expected = ARKIT_FROM_ROOM @ camera.world_from_camera
        assert np.abs(capture.camera.world_from_camera - expected).max() < 1e-9
        assert (capture.camera.fx, capture.camera.cx) == (camera.fx, camera.cx)
        depth = imported.depth.of(capture, capture.name.split(".")[0])
        true = room.depth(camera.scaled(0.64))
        assert depth is not None and np.abs(depth - np.where(true < 5.0, true, 0.0)).max() < 1e-3


def test_without_lenses_of_frames_the_one_of_the_recording_counts(export):
    folder, data = export
    (folder / "metadata.json").write_text(json.dumps(data))
    shutil.rmtree(folder / "depth")
    imported = import_captures(folder, None, SETTINGS)
    assert {capture.camera.fx for capture in imported.captures} == {290.0}
    assert imported.depth is None


def test_of_a_long_recording_the_sharp_ones_are_taken_and_told(export, messages):
    folder, _ = export
    imported = import_captures(folder, None, CaptureSettings(max_keyframes=3), messages)
    assert len(imported.captures) == 3
    assert any("3 of the 5" in text for _, text in messages.messages)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"poses": [[0, 0, 0, 1, 0, 0]] * 5}, "poses"),
        ({"poses": [[0, 0, 0, 0, 0, 0, 0]] * 5}, "poses[0]"),
        ({"K": [1, 2, 3]}, "K"),
        ({"w": -4}, "w"),
        ({"perFrameIntrinsicCoeffs": [["a"] * 4]}, "perFrameIntrinsicCoeffs"),
    ],
    ids=["six numbers", "no rotation", "no matrix", "no width", "no lenses"],
)
def test_what_is_none_is_refused_with_its_field(export, change, field):
    folder, data = export
    (folder / "metadata.json").write_text(json.dumps({**data, **change}))
    with refused(CaptureError) as caught:
        import_captures(folder, None, SETTINGS)
    assert "metadata.json" in str(caught.value) and field in str(caught.value)


def test_other_metadata_is_no_export(tmp_path):
    (tmp_path / "metadata.json").write_text(json.dumps({"title": "a film"}))
    with pytest.raises(CaptureError):
        find_poses(tmp_path)

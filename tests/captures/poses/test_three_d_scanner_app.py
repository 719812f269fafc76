"""Exports of 3D Scanner App, written from a room whose geometry is known."""

from __future__ import annotations

import json

import numpy as np
import pytest
from expected_errors import refused
from phone_recordings import ARKIT_FROM_ROOM, DEPTH_SHARE, three_d_scanner_app

from r2sego_blender.captures.importing import import_captures
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import to_uint8

SETTINGS = CaptureSettings()


@pytest.fixture
def export(tmp_path, room, room_cameras):
    images = [to_uint8(room.image(camera)) for camera in room_cameras]
    return three_d_scanner_app(tmp_path / "2026_11_28", room_cameras, images, room.depth)


def test_cameras_and_depth_are_those_of_the_room(export, room, room_cameras):
    imported = import_captures(export, None, SETTINGS)
    assert imported.metric and np.array_equal(imported.up, [0.0, 1.0, 0.0])
    assert [capture.name for capture in imported.captures] == [f"frame_{2 * i:05d}.jpg" for i in range(5)]
    for capture, camera in zip(imported.captures, room_cameras, strict=True):
        assert np.abs(capture.camera.world_from_camera - ARKIT_FROM_ROOM @ camera.world_from_camera).max() < 1e-12
        assert (capture.camera.fx, capture.camera.cx) == (camera.fx, camera.cx)
        true = np.round(1000.0 * room.depth(camera.scaled(DEPTH_SHARE)))
        believed = (true % 2 == 0) & (true <= 5000.0)
        found = imported.depth.of(capture, capture.name.split(".")[0])
        assert np.array_equal(found > 0.0, believed) and np.abs(found - true / 1000.0)[believed].max() < 1e-5


def test_a_scan_without_depth_has_none(export):
    for file in [*export.glob("depth_*"), *export.glob("conf_*")]:
        file.unlink()
    assert import_captures(export, None, SETTINGS).depth is None


def test_of_a_long_scan_the_sharp_ones_are_taken_and_told(export, messages):
    imported = import_captures(export, None, CaptureSettings(max_keyframes=3), messages)
    assert len(imported.captures) == 3
    assert any("3 of the 5" in text for _, text in messages.messages)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"cameraPoseARFrame": [1.0] * 15}, "cameraPoseARFrame"),
        ({"cameraPoseARFrame": [0.0] * 16}, "frame_00004.json"),
        ({"intrinsics": [0.0] * 9}, "frame_00004.json"),
        ({"intrinsics": [1.0] * 3}, "intrinsics"),
    ],
    ids=["fifteen numbers", "no rotation", "no focal length", "three numbers"],
)
def test_what_is_none_is_refused_with_its_field(export, change, field):
    file = export / "frame_00004.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), **change}))
    with refused(CaptureError) as caught:
        import_captures(export, None, SETTINGS)
    assert "frame_00004.json" in str(caught.value) and field in str(caught.value)

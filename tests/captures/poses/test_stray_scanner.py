"""Recordings of Stray Scanner, written from a room whose geometry is known."""

from __future__ import annotations

import itertools
import shutil

import numpy as np
import pytest
from expected_errors import refused
from phone_recordings import ARKIT_FROM_ROOM, DEPTH_SHARE, stray_scanner
from phone_videos import filmed, walk, write_video

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.importing import import_captures
from r2sego_blender.captures.poses.dropped_files import capture_files
from r2sego_blender.captures.poses.registry import find_poses, find_recording
from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.images import save_image
from r2sego_blender.refine.creation import create_scene

SETTINGS = CaptureSettings()
# The sensor lies while the phone stands: its rows run from the right of the picture to its left.
_PICTURE_FROM_SENSOR = np.array([[0.0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


def sensor(camera):
    """The camera of the sensor, of an upright picture's."""
    pose = camera.world_from_camera @ np.linalg.inv(_PICTURE_FROM_SENSOR)
    return Camera(camera.height, camera.width, camera.fy, camera.fx, camera.cy, camera.cx, pose)


@pytest.fixture
def recording(tmp_path, room, room_cameras):
    folder = tmp_path / "71de12f9"
    stray_scanner(folder, room_cameras, room.depth)
    return folder


@pytest.fixture
def frames(tmp_path, room, room_cameras):
    """The recording's frames as files, but for the second."""
    folder = tmp_path / "frames"
    folder.mkdir()
    for number, camera in enumerate(room_cameras):
        if number != 1:
            save_image(folder / f"{number:06d}.png", room.image(camera))
    return folder


@pytest.mark.parametrize("lens_of_frames", [True, False])
def test_cameras_and_depth_are_those_of_the_room(recording, frames, room, room_cameras, lens_of_frames):
    stray_scanner(recording, room_cameras, room.depth, lens_of_frames)
    imported = import_captures(frames, recording / "odometry.csv", SETTINGS)
    assert imported.metric and np.array_equal(imported.up, [0.0, 1.0, 0.0])
    assert [capture.name for capture in imported.captures] == [f"{number:06d}.png" for number in (0, 2, 3, 4)]
    for capture in imported.captures:
        camera = room_cameras[int(capture.name[:6])]
        assert np.abs(capture.camera.world_from_camera - ARKIT_FROM_ROOM @ camera.world_from_camera).max() < 1e-9
        assert (capture.camera.fx, capture.camera.cx) == (camera.fx, camera.cx)
        true = np.round(1000.0 * room.depth(camera.scaled(DEPTH_SHARE)))
        believed = (true % 2 == 0) & (true <= 5000.0)
        found = imported.depth.of(capture, capture.name[:6])
        assert np.array_equal(found > 0.0, believed) and np.abs(found - true / 1000.0)[believed].max() < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("by", ["folder", "video"])
def test_a_recording_becomes_a_bundle_with_its_poses_and_depth(tmp_path, room, by):
    count, shakes = 24, range(1, 24, 4)
    folder = tmp_path / "scan"
    stray_scanner(folder, [sensor(walk(number / (count - 1))) for number in range(count)], room.depth)
    # An editor that turned the video by its header does not turn what the poses are of.
    write_video(folder / "rgb.mp4", filmed(room.image, count, shakes), turns=1)
    settings = CaptureSettings(max_features=2500, max_keyframes=6)
    scene = create_scene(tmp_path / "scan.r2s", folder / "rgb.mp4" if by == "video" else folder, settings=settings)
    captures = scene.read(CAPTURES)
    declared = Scene.open(scene.path).declaration
    assert len(captures) == 6 == len(declared.captures_chosen)
    assert "Stray Scanner" in declared.captures_source and "rgb.mp4" in declared.captures_source
    numbers = [int(capture.name[:6]) for capture in captures]
    assert not set(numbers) & set(shakes)
    for first, second in itertools.pairwise(captures):
        true = [sensor(walk(int(one.name[:6]) / (count - 1))) for one in (first, second)]
        moved = first.camera.camera_from_world @ second.camera.world_from_camera
        assert np.abs(moved - true[0].camera_from_world @ true[1].world_from_camera).max() < 0.02
    heights = [capture.camera.centre[2] for capture in captures]
    assert np.abs(np.array(heights) - 1.5).max() < 0.03
    assert len(list((scene.path / "captures").glob("*depth*"))) == 1


def test_what_is_dropped_of_a_recording_is_its_folder(recording):
    (recording / "rgb.mp4").write_bytes(b"\0\0\0\x18ftypmp42")
    for dropped in (recording, recording / "rgb.mp4", recording / "odometry.csv"):
        found = capture_files([dropped], ".r2s")
        assert (found.photographs, found.poses) == (recording, None)
        assert found.scene == recording.with_name("71de12f9.r2s")
    other = shutil.copy(recording / "rgb.mp4", recording.parent / "other.mp4")
    assert capture_files([other], ".r2s").photographs == other


def test_another_video_or_folder_is_no_recording(recording, frames):
    odometry = recording / "odometry.csv"
    assert find_poses(recording)[1] == odometry
    assert find_recording(recording) is None  # it has no video
    (recording / "rgb.mp4").write_bytes(b"")
    assert find_recording(recording) == find_recording(recording / "rgb.mp4") == (recording / "rgb.mp4", odometry)
    assert find_recording(frames, odometry) is None and find_recording(frames) is None


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        (", cx", ", c", "frame 0"),
        (", 000003", ", 000002", "line 5"),
        (", 000003", ", x", "line 5"),
        (", 000004", ", 000009", "000004.png"),
        ("fx", "f", "camera_matrix.csv"),
        (", 300.0", ", nan", "frame 0"),
    ],
    ids=["no column", "a number twice", "no number", "no pose of a frame", "no lens", "nan"],
)
def test_what_is_none_is_refused_with_its_field(recording, frames, old, new, field):
    odometry = recording / "odometry.csv"
    odometry.write_text(odometry.read_text().replace(old, new, 1))
    (recording / "camera_matrix.csv").write_text("1, 2\n3, 4")
    with refused(CaptureError) as caught:
        import_captures(frames, odometry, SETTINGS)
    assert field in str(caught.value)


def test_without_its_frames_a_recording_says_who_takes_them(recording):
    with refused(CaptureError):
        import_captures(recording, None, SETTINGS)

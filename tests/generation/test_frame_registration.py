"""Registration of frames: known poses are recovered, bad frames are rejected with a reason."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from r2sego_blender.cameras import rotation_angle_rad
from r2sego_blender.captures.capture import Capture
from r2sego_blender.errors import GenerationError
from r2sego_blender.generation.registration import Landmarks, register_frame
from r2sego_blender.images import save_image
from r2sego_blender.settings import RegistrationSettings

SETTINGS = RegistrationSettings(max_features=2000)


@pytest.fixture(scope="module")
def landmarks(room_a):
    return Landmarks.build(room_a.captures, room_a.depths, None, SETTINGS)


def perturbed(camera, seed, offset_m=0.05, turn_deg=2.0):
    rng = np.random.default_rng(seed)
    axis, way = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
    pose = camera.world_from_camera.copy()
    pose[:3, :3] = Rotation.from_rotvec(np.radians(turn_deg) * axis).as_matrix() @ pose[:3, :3]
    pose[:3, 3] += offset_m * way
    return camera.at(pose)


@pytest.mark.parametrize("index", [0, 5, 12])
def test_a_perturbed_query_is_corrected(room_a, landmarks, index):
    view = room_a.frozen[index]
    query = perturbed(view.camera, index)
    frame = register_frame(view.image(), query, room_a.captures[0].camera, landmarks, SETTINGS, seed=1)
    assert frame.camera is not None, frame.reason
    assert np.linalg.norm(frame.camera.centre - view.camera.centre) < 0.02
    turn = rotation_angle_rad(frame.camera.world_from_camera, view.camera.world_from_camera)
    assert np.degrees(turn) < 0.5
    assert abs(frame.focal_px / view.camera.fx - 1.0) < 0.03
    assert abs(frame.offset_m - 0.05) < 0.02
    again = register_frame(view.image(), query, room_a.captures[0].camera, landmarks, SETTINGS, seed=1)
    np.testing.assert_array_equal(again.camera.world_from_camera, frame.camera.world_from_camera)


def test_each_gate_says_why(room_a, landmarks):
    view, reference = room_a.frozen[0], room_a.captures[0].camera
    image = view.image()

    def reason(query, image=image, **limits):
        settings = replace(SETTINGS, max_features=800, **limits)
        frame = register_frame(image, query, reference, landmarks, settings)
        assert frame.camera is None
        return frame.reason

    assert "m from its query" in reason(perturbed(view.camera, 0, 0.3, 0.0))
    assert "turned" in reason(perturbed(view.camera, 0, 0.0, 8.0), search_radius_px=200.0)
    assert "matches agree" in reason(view.camera, min_inliers=9000)
    corner = np.full_like(image, 0.5)
    corner[:240, :320] = image[:240, :320]
    assert "of the image" in reason(view.camera, corner, min_spread=0.5, min_inliers=6)
    long = replace(view.camera, fx=view.camera.fx * 1.15, fy=view.camera.fy * 1.15)
    assert "focal length" in reason(long, max_offset_m=5.0, max_turn_deg=90.0, search_radius_px=200.0)


def test_a_frame_without_texture_is_rejected(room_a, landmarks):
    camera = room_a.captures[0].camera
    frame = register_frame(np.full((*camera.shape, 3), 0.5, np.float32), camera, camera, landmarks, SETTINGS)
    assert frame.camera is None
    assert frame.estimate is None
    assert frame.reason == "rejected: no pose fits the 0 matches with the captures"


def test_landmarks_lie_on_the_room(room_a, landmarks):
    """A landmark of one capture lies at another capture's depth, or is hidden behind it."""
    other = room_a.captures[1].camera
    pixels, z = other.project(landmarks.points[landmarks.capture == 0])
    inside = other.sees(pixels, z)
    columns, rows = pixels[inside].astype(int).T
    ratio = z[inside] / room_a.depths[1][rows, columns]
    assert np.mean(np.abs(ratio - 1.0) < 0.02) > 0.6
    assert np.mean(ratio < 0.98) < 0.02


def test_unreliable_depths_give_no_landmarks(tmp_path, box_room):
    rng = np.random.default_rng(0)
    camera = box_room.captures[0].camera
    image = np.kron(rng.random((15, 20, 3)), np.ones((8, 8, 1))).astype(np.float32)
    save_image(tmp_path / "a.png", image)
    capture = Capture("a", tmp_path / "a.png", camera)
    left = np.zeros(camera.shape, bool)
    left[:, : camera.width // 2] = True
    landmarks = Landmarks.build([capture], [box_room.depths[0]], [left], SETTINGS)
    pixels, _ = camera.project(landmarks.points)
    assert len(pixels) > 5
    assert pixels[:, 0].max() < camera.width / 2
    with pytest.raises(GenerationError, match="no capture has features"):
        Landmarks.build([capture], [box_room.depths[0]], [~left & left], SETTINGS)

"""Photographs whose poses contradict the others' are found, and located where the others tell."""

from __future__ import annotations

import numpy as np
import pytest
from measured_tracks import arc, measured
from scipy.spatial.transform import Rotation

from r2sego_blender.captures.solving.pose_agreement import contradictions
from r2sego_blender.core.cameras import rotation_angle_rad

BAND_PX = 10.0


def _turned(camera, degrees, axis=(0.0, 0.0, 1.0)):
    pose = camera.world_from_camera.copy()
    pose[:3, :3] = Rotation.from_rotvec(np.radians(degrees) * np.array(axis)).as_matrix() @ pose[:3, :3]
    return camera.at(pose)


def _moved(camera, offset):
    pose = camera.world_from_camera.copy()
    pose[:3, 3] += offset
    return camera.at(pose)


@pytest.mark.parametrize(
    "wrong",
    [
        # about the vertical: points slide along their epipolar lines
        {2: lambda cameras: _turned(cameras[2], 6.0)},
        {2: lambda cameras: _moved(cameras[2], (0.2, 0.18, 0.0))},
        {3: lambda cameras: cameras[2], 4: lambda cameras: cameras[2]},
        {2: lambda cameras: cameras[2].at(np.eye(4)), 5: lambda cameras: cameras[5].at(np.eye(4))},
        {0: lambda cameras: _turned(cameras[0], 90.0, (1.0, 0.0, 0.0))},
    ],
    ids=["turned", "moved", "frozen", "lost", "first"],
)
def test_wrong_poses_are_named_and_located(wrong, rng):
    cameras = arc(8)
    _, pixels = measured(cameras, rng)
    given = [wrong[index](cameras) if index in wrong else camera for index, camera in enumerate(cameras)]
    found = contradictions(given, pixels, BAND_PX, 15)
    assert [one.photograph for one in found] == sorted(wrong)
    for one in found:
        assert one.agreeing < 0.3 * one.shared and one.located > 0.9 * one.shared
        assert np.linalg.norm(one.camera.centre - cameras[one.photograph].centre) < 0.01
        right = cameras[one.photograph].world_from_camera
        assert np.degrees(rotation_angle_rad(one.camera.world_from_camera, right)) < 0.2


def test_right_poses_and_such_as_are_a_little_wrong_are_not_named(rng):
    cameras = arc(8)
    _, pixels = measured(cameras, rng)
    assert contradictions(cameras, pixels, BAND_PX, 15) == []
    little = [_turned(_moved(c, rng.normal(0, 0.01, 3)), 0.3, rng.normal(0, 0.6, 3)) for c in cameras]
    assert contradictions(little, pixels, BAND_PX, 15) == []


def test_chance_matches_are_located_nowhere(rng):
    cameras = arc(6)
    _, pixels = measured(cameras, rng)
    seen = np.isfinite(pixels[:, 3, 0])
    pixels[seen, 3] = rng.uniform((0, 0), (640, 480), (seen.sum(), 2))
    (found,) = contradictions(cameras, pixels, BAND_PX, 15)
    assert found.photograph == 3 and found.camera is None


def test_where_most_are_wrong_none_is_blamed(rng):
    cameras = arc(6)
    _, pixels = measured(cameras, rng)
    lost = [camera.at(np.eye(4)) if index < 4 else camera for index, camera in enumerate(cameras)]
    assert contradictions(lost, pixels, BAND_PX, 15) == []
    assert contradictions(cameras, pixels[:0], BAND_PX, 15) == []

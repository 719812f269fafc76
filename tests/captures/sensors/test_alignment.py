"""A sensor beside the camera: where it stands is found, and none is invented."""

from __future__ import annotations

import numpy as np
import pytest

from r2sego_blender.captures.sensors.alignment import SensorPose, estimate_sensor_pose


def _seen_px(capture, depth, pose: SensorPose) -> np.ndarray:
    """Where the camera sees what a sensor at ``pose`` measured at pixels of its own, (n, 2)."""
    camera = capture.camera
    v, u = np.mgrid[20 : camera.height : 40, 20 : camera.width : 40]
    z = depth[v, u].ravel()
    rays = (np.stack([u.ravel() + 0.5, v.ravel() + 0.5], axis=1) - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    points = np.column_stack([rays / pose.focal_ratio, np.ones(len(z))]) * z[:, None]
    points = points @ pose.camera_from_sensor[:3, :3].T + pose.camera_from_sensor[:3, 3]
    return points[:, :2] / points[:, 2:] * [camera.fx, camera.fy] + [camera.cx, camera.cy]


@pytest.mark.parametrize(
    "true",
    [
        {"turn_deg": (0.0, 1.5, 0.0)},
        {"turn_deg": (-1.0, 0.0, 0.5)},
        {"shift_m": (0.025, 0.0, 0.0)},
        {"focal_ratio": 1.03},
        {"turn_deg": (0.5, -0.8, 0.0), "shift_m": (0.02, 0.01, 0.0), "focal_ratio": 0.98},
    ],
    ids=["turned", "turned about two axes", "a baseline", "another lens", "all of them"],
)
def test_the_residual_between_sensor_and_camera_is_found(sensor_room, sensor_at, rng, true) -> None:
    pose = sensor_at(**true)
    found = estimate_sensor_pose(sensor_room.captures, sensor_room.sparse, sensor_room.maps(pose, rng, noise=0.01))
    # A turn, a shift and a lens look alike over one room: what counts is where the measurements are seen.
    errors = [
        np.linalg.norm(_seen_px(c, d, found) - _seen_px(c, d, pose), axis=1)
        for c, d in zip(sensor_room.captures, sensor_room.depths, strict=True)
    ]
    uncorrected = [
        np.linalg.norm(_seen_px(c, d, SensorPose.aligned()) - _seen_px(c, d, pose), axis=1)
        for c, d in zip(sensor_room.captures, sensor_room.depths, strict=True)
    ]
    assert not found.is_aligned
    assert np.median(errors) < 1.0
    assert np.median(errors) < 0.35 * np.median(uncorrected)


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.02])
def test_an_aligned_sensor_stays_as_it_is(sensor_room, rng, noise) -> None:
    maps = sensor_room.maps(SensorPose.aligned(), rng, noise)
    assert estimate_sensor_pose(sensor_room.captures, sensor_room.sparse, maps).is_aligned


def test_too_few_maps_say_nothing(sensor_room, sensor_at, rng) -> None:
    maps = sensor_room.maps(sensor_at(turn_deg=(0.0, 1.5, 0.0)), rng, 0.01)
    few = [one if index < 3 else None for index, one in enumerate(maps)]
    assert estimate_sensor_pose(sensor_room.captures, sensor_room.sparse, few).is_aligned

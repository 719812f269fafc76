"""A sensor beside the camera: where it stands is found, and none is invented."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import map_coordinates
from scipy.spatial.transform import Rotation

from r2sego_blender.captures.sensors.alignment import SensorPose, _behind, _edge_distances, estimate_sensor_pose


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


LENS = np.array([41.0, 43.0, 24.3, 17.1])
SHAPE = (36, 48)


def in_map(points: np.ndarray, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """Where a picture with ``LENS`` and ``ratio`` times its focal lengths shows points (n, 3): rows and columns
    between pixels' middles (2, n), and whether there are four around them (n,)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        place = ratio * points[:, :2] / points[:, 2:] * LENS[:2] + LENS[2:] - 0.5
    inside = (points[:, 2] >= 0.1) & (place >= 0).all(1) & (place < np.array(SHAPE)[::-1] - 1).all(1)
    return np.where(inside, place[:, ::-1].T, 0.0), inside


@pytest.mark.parametrize("seed", range(3))
def test_what_a_sensor_is_judged_by_is_its_plain_reference(seed) -> None:
    rng = np.random.default_rng(seed)
    rotation = Rotation.from_rotvec(rng.normal(0.0, 0.05, 3))
    shift, ratio = rng.normal(0.0, 0.05, 3), float(rng.uniform(0.9, 1.1))
    depth = rng.uniform(1.0, 3.0, SHAPE).astype(np.float32)
    smooth, edges = rng.random(SHAPE) < 0.8, rng.uniform(0.0, 12.0, SHAPE).astype(np.float32)
    points = rng.uniform([-1.5, -1.5, -0.5], [1.5, 1.5, 3.0], (2000, 3))
    given = (rotation.as_matrix(), shift, ratio, LENS)

    sensor = rotation.inv().apply(points - shift)  # what the camera sees, as the sensor would
    place, inside = in_map(sensor, ratio)
    inside &= smooth[tuple((place + 0.5).astype(int))]
    behind = 1.0 - map_coordinates(depth, place, order=1) / sensor[:, 2]
    found = np.empty(len(points))
    _behind(points, *given, depth, smooth, found)
    assert 0.1 < inside.mean() < 0.9
    np.testing.assert_allclose(found, np.where(inside, behind, np.nan), rtol=1e-5, atol=1e-5)

    camera = rotation.apply(points / [ratio, ratio, 1.0]) + shift  # what the sensor sees, as the camera does
    place, inside = in_map(camera, 1.0)
    distance = np.minimum(map_coordinates(edges, place, order=1), 6.0)
    _edge_distances(points, *given, edges, found)
    assert 0.1 < inside.mean() < 0.9
    np.testing.assert_allclose(found, np.where(inside, distance, 6.0), rtol=1e-5, atol=1e-5)

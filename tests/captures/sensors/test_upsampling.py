"""Upsampling along the photograph's edges: against a plain reference, planes exactly, edges sharp."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from box_room import arc, render

from r2sego_blender.captures.sensors import upsampling
from r2sego_blender.captures.sensors.sensor_maps import SensorMap
from r2sego_blender.captures.sensors.upsampling import upsampled
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.images import resize

LENS = Camera(96, 72, 60.0, 60.0, 48.0, 36.0, np.eye(4))


def _plain(image: np.ndarray, sensor: SensorMap, row: int, column: int) -> float:
    """The weighted median's surface at a pixel, with no loop but over the measurements near."""
    small = resize(image, sensor.camera.width, sensor.camera.height)
    height, width = image.shape[:2]
    v = (row + 0.5) * sensor.camera.height / height - 0.5
    u = (column + 0.5) * sensor.camera.width / width - 0.5
    rows, columns = np.mgrid[: sensor.camera.height, : sensor.camera.width]
    near = (np.abs(rows - v) <= upsampling._REACH) & (np.abs(columns - u) <= upsampling._REACH)
    apart = ((columns - u) ** 2 + (rows - v) ** 2)[near] / upsampling._SPACE_SIGMA**2
    off = ((small[near] - image[row, column]) ** 2).sum(axis=1) / upsampling._COLOUR_SIGMA**2
    weight, depth = np.exp(-0.5 * (apart + off)) + 1e-12, sensor.depth[near]
    known = depth > 0.0
    if not known.any() or weight[known].sum() < 0.5 * weight.sum():
        return 0.0
    order = np.argsort(depth[known], kind="stable")
    values, weights = depth[known][order], weight[known][order]
    middle = values[np.searchsorted(np.cumsum(weights), 0.5 * weights.sum())]
    same = np.abs(values - middle) <= upsampling._SAME_SURFACE * middle
    return weights[same].sum() / (weights[same] / values[same]).sum()


def test_it_is_what_the_plain_reference_says(rng) -> None:
    small = LENS.scaled(0.4)
    depth = rng.uniform(0.5, 3.0, small.shape).astype(np.float32)
    depth[rng.random(small.shape) < 0.3] = 0.0
    sensor = SensorMap(depth, 0.01 * depth, small)
    image = rng.random((*LENS.shape, 3)).astype(np.float32)
    found, sigma = upsampled(sensor, image, LENS)
    expected = np.array([[_plain(image, sensor, row, column) for column in range(96)] for row in range(72)])
    close = np.abs(found - expected) < 1e-3
    assert close.mean() > 0.999  # a median of equal halves may fall to either side
    assert ((found > 0.0) == (sigma > 0.0)).all()


def test_a_plane_stays_a_plane(rng) -> None:
    small = LENS.scaled(0.4)
    planes = [1.0 / (camera.rays() @ [0.05, -0.1, 0.5]) for camera in (small, LENS)]
    sensor = SensorMap(planes[0].astype(np.float32), np.full(small.shape, 0.01, np.float32), small)
    found, _ = upsampled(sensor, np.full((*LENS.shape, 3), 0.5, np.float32), LENS)
    inner = np.s_[4:-4, 4:-4]
    assert np.abs(found / planes[1] - 1.0)[inner].max() < 0.01


def test_edges_follow_the_photograph() -> None:
    """A map of a third of the resolution: silhouettes are where the picture has them."""
    camera = arc(3, 192, 144)[1]

    def colour(points: np.ndarray) -> np.ndarray:  # the table is of another colour than the room
        table = (points[..., 2] > 0.01) & (points[..., 2] < 0.71) & (np.abs(points[..., 0]) < 0.41)
        return np.where((table & (points[..., 1] < 0.81))[..., None], [0.8, 0.2, 0.1], [0.3, 0.5, 0.6])

    image, true = render(camera, colour=colour)
    small = replace(camera.scaled(1 / 3), world_from_camera=camera.world_from_camera)
    depth = render(small, colour=colour)[1]
    sensor = SensorMap(depth, 0.01 * depth, small)
    found, _ = upsampled(sensor, image, camera)
    nearest = np.repeat(np.repeat(depth, 3, 0), 3, 1)
    wrong, wrong_nearest = ((np.abs(one / true - 1.0) > 0.05).mean() for one in (found, nearest))
    assert (found > 0.0).mean() > 0.99
    assert wrong < 0.4 * wrong_nearest

"""Captures of a room with boxes whose depth sensor stands somewhere beside the camera."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from box_room import TABLE, lens, render
from measured_points import measured

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.sensors.alignment import SensorPose
from r2sego_blender.captures.sparse_points import SparsePoints
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.images import save_image

BOXES = (
    TABLE,
    (np.array([-1.6, 0.9, 0.0]), np.array([-1.1, 1.5, 1.2])),
    (np.array([0.9, -0.2, 0.0]), np.array([1.3, 0.3, 0.9])),
)
"""Edges of depth at several distances."""


@dataclass(frozen=True)
class SensorRoom:
    """Captures with their exact depth, and points that they triangulated with half a pixel's noise."""

    captures: list[Capture]
    depths: list[np.ndarray]
    sparse: SparsePoints
    boxes: tuple[tuple[np.ndarray, np.ndarray], ...] = BOXES

    def maps(self, pose: SensorPose, rng: np.random.Generator, noise: float, scale: float = 0.6) -> list[np.ndarray]:
        """What a sensor at ``pose`` measures, with relative ``noise``."""
        found = []
        for capture in self.captures:
            camera = capture.camera.scaled(scale)
            camera = replace(camera, fx=camera.fx * pose.focal_ratio, fy=camera.fy * pose.focal_ratio)
            depth = render(camera.at(camera.world_from_camera @ pose.camera_from_sensor), BOXES)[1]
            found.append((depth * (1.0 + noise * rng.normal(size=depth.shape))).astype(np.float32))
        return found


def _cameras() -> list[Camera]:
    around = np.linspace(-1.2, 1.2, 10)
    places = [
        np.array([1.7 * np.sin(a), -1.7 * np.cos(a), height]) for a, height in zip(around, [1.2, 1.7] * 5, strict=True)
    ]
    return [lens(320, 240).at(look_at(place, [0.0, 0.5, 0.5 + 0.3 * (i % 3)])) for i, place in enumerate(places)]


@pytest.fixture(scope="session")
def sensor_room(tmp_path_factory) -> SensorRoom:
    folder, rng = tmp_path_factory.mktemp("sensor_room"), np.random.default_rng(3)
    captures, depths, points = [], [], []
    for index, camera in enumerate(_cameras()):
        image, depth = render(camera, BOXES)
        save_image(folder / f"{index}.png", image)
        captures.append(Capture(f"{index}.png", folder / f"{index}.png", camera))
        depths.append(depth)
        surface = camera.unproject(depth).reshape(-1, 3)
        points.append(surface[rng.choice(len(surface), 200, replace=False)])
    sparse = measured(np.concatenate(points), [c.camera for c in captures], margin_px=2.0)
    visible = sparse.visibility.copy()
    for index, (capture, depth) in enumerate(zip(captures, depths, strict=True)):
        pixels, z = capture.camera.project(sparse.points)
        u, v = np.where(visible[:, index, None], pixels, 0.0).astype(int).T
        visible[:, index] &= np.abs(depth[v, u] - z) < 0.05 * z
    kept = visible.sum(axis=1) >= 2
    pixels = np.where(visible[..., None], sparse.pixels, np.nan)
    # Along its rays a point is unsure: half a pixel at the usual angles is a hundredth of its distance.
    noisy = sparse.points * (1.0 + 0.004 * rng.normal(size=(len(sparse.points), 1)))
    return SensorRoom(
        captures,
        depths,
        SparsePoints(noisy[kept], sparse.colours[kept], visible[kept], sparse.error_px[kept], pixels[kept]),
    )


@pytest.fixture
def sensor_at() -> Callable[..., SensorPose]:
    from scipy.spatial.transform import Rotation

    def pose(turn_deg=(0.0, 0.0, 0.0), shift_m=(0.0, 0.0, 0.0), focal_ratio=1.0) -> SensorPose:
        camera_from_sensor = np.eye(4)
        camera_from_sensor[:3, :3] = Rotation.from_rotvec(turn_deg, degrees=True).as_matrix()
        camera_from_sensor[:3, 3] = shift_m
        return SensorPose(camera_from_sensor, focal_ratio)

    return pose

"""Steadiness: a painted wall is steady from any view, a flicker shows by its size."""

import numpy as np
import pytest

from r2sego_blender.core.cameras import Camera, look_at
from tools.benchmarks.steadiness import flow_differences


def clip(frames: int = 4):
    """Views of a wall at y = 2 whose colour is linear in x and z, so bilinear reading is exact."""
    cameras = [
        Camera(80, 60, 60.0, 60.0, 40.0, 30.0, look_at((0.1 * t, 0.0, 1.0), (0.1 * t, 1.0, 1.0))) for t in range(frames)
    ]
    depths = [np.full((60, 80), 2.0, np.float32)] * frames
    images = []
    for camera, depth in zip(cameras, depths, strict=True):
        points = camera.unproject(depth)
        images.append((0.5 + 0.1 * points).astype(np.float32))
    return images, cameras, depths


def test_a_painted_wall_is_steady():
    np.testing.assert_allclose(flow_differences(*clip()), 0.0, atol=2e-4)


@pytest.mark.parametrize("size", [0.01, 0.1])
def test_flicker_is_measured(size):
    images, cameras, depths = clip()
    images[1] = images[1] + np.float32(size)
    np.testing.assert_allclose(flow_differences(images, cameras, depths), [size, size, 0.0], atol=1e-3)


def test_what_the_next_frame_hides_does_not_count():
    images, cameras, depths = clip(2)
    depths = [depths[0], np.ones_like(depths[1])]
    images[1] = np.zeros_like(images[1])
    np.testing.assert_array_equal(flow_differences(images, cameras, depths), [0.0])

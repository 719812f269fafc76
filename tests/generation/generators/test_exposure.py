"""Exposure gains: known gains are found, equal exposures are left alone."""

import numpy as np
import pytest
from box_room import arc, render

from r2sego_blender.generation.generators.exposure import exposure_gains


def test_known_gains_are_undone():
    cameras = arc(3)
    images, depths = zip(*(render(camera) for camera in cameras), strict=True)
    applied = np.array([[1.0, 1.0, 1.0], [0.8, 0.85, 0.9], [1.1, 1.05, 1.0]])
    gains = exposure_gains([i * g for i, g in zip(images, applied, strict=True)], cameras, depths, 0.03)
    corrected = gains * applied
    np.testing.assert_allclose(corrected / corrected[0], np.ones((3, 3)), atol=0.02)
    np.testing.assert_allclose(np.exp(np.log(gains).mean(axis=0)), 1.0, atol=1e-6)


@pytest.mark.parametrize(("light", "gain"), [(0.8, 1.9), (0.03, 1.5)])
def test_clipped_pixels_say_nothing_of_exposure(light, gain):
    """Most of a wall is white in the second photograph, or nearly black in both; the rest tells the gain."""
    camera = arc(1)[0]
    wall = np.where(np.arange(camera.width) < 0.6 * camera.width, light, 0.3)
    image = np.broadcast_to(wall[:, None], (*camera.shape, 3)).astype(np.float32)
    bright = np.minimum(gain * image, 1.0)
    bright[image < 0.05] = 0.04  # what a black pixel is says its noise
    depth = np.full(camera.shape, 2.0, np.float32)
    gains = exposure_gains([image, bright], [camera] * 2, [depth] * 2, 0.03)
    np.testing.assert_allclose(gains[0] / gains[1], gain, rtol=0.05)


def test_captures_without_overlap_keep_their_exposure():
    camera = arc(1)[0]
    image, depth = render(camera)
    turned = camera.world_from_camera @ np.diag([-1.0, 1.0, -1.0, 1.0])
    away = camera.at(turned)
    other, other_depth = render(away)
    gains = exposure_gains([image, 0.5 * other], [camera, away], [depth, other_depth], 0.03)
    np.testing.assert_array_equal(gains, 1.0)

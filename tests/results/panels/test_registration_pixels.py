"""Clicks become pixels and pixels rays, without a window."""

import fake_bundle
import numpy as np
import pytest

from r2sego_blender.results.panels.registration_pixels import next_name, pixel_of_ray, points_at


@pytest.mark.parametrize("camera", fake_bundle.cameras())
def test_a_pixels_ray_comes_back_to_it(camera):
    pixels = np.random.default_rng(0).uniform(0, 1, (20, 2)) * (camera.width, camera.height)
    points = points_at(camera, pixels, 1.7)
    back, depth = camera.project(points)
    np.testing.assert_allclose(back, pixels, atol=1e-9)
    np.testing.assert_allclose(depth, 1.7)
    for pixel, point in zip(pixels, points, strict=True):
        np.testing.assert_allclose(pixel_of_ray(camera, 3.0 * (point - camera.centre)), pixel, atol=1e-9)


def test_a_ray_beside_or_behind_is_no_pixel():
    camera = fake_bundle.cameras()[0]
    (beside,) = points_at(camera, (-1.0, 5.0))
    assert pixel_of_ray(camera, beside - camera.centre) is None
    assert pixel_of_ray(camera, -camera.forward) is None


def test_names_are_letters_that_are_free():
    assert next_name([]) == "A"
    assert next_name(["A", "C"]) == "B"
    assert next_name([chr(ord("A") + i) for i in range(26)]) == "A1"

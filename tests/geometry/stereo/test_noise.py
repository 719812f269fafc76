"""Noise is measured where it is, and taken away without taking the picture."""

import cv2
import numpy as np
import pytest

from r2sego_blender.geometry.stereo.noise import noise_sigma, without_noise


@pytest.fixture
def picture() -> np.ndarray:
    """Shaded walls with straight edges, and a third of fine texture; (240, 320) in [0, 1]."""
    rng = np.random.default_rng(3)
    v, u = np.mgrid[0:240, 0:320].astype(np.float32)
    grey = 0.3 + 0.2 * u / 320 + 0.1 * v / 240
    grey[80:200, 60:150] += 0.2
    grey[:, 220:] += 0.3 * cv2.GaussianBlur(rng.normal(size=(240, 100)).astype(np.float32), (0, 0), 1.0)
    return np.clip(grey, 0.05, 0.95)


@pytest.mark.parametrize("steps", [1.5, 3.0, 6.0])
def test_noise_is_measured_beside_texture(picture, steps):
    noisy = picture + np.random.default_rng(0).normal(0.0, steps / 255, picture.shape)
    assert noise_sigma(noisy) * 255 == pytest.approx(steps, rel=0.1)


def test_a_photograph_without_noise_is_returned_as_it_is(picture):
    rounded = np.rint(picture * 255) / np.float32(255)
    assert noise_sigma(rounded) * 255 < 0.6
    assert without_noise(rounded) is rounded
    tiny = np.random.default_rng(0).random((9, 40)).astype(np.float32)
    assert without_noise(tiny) is tiny


@pytest.mark.parametrize("steps", [2.0, 3.0])
def test_what_is_left_is_a_step_of_noise_and_the_picture(picture, steps):
    noisy = (picture + np.random.default_rng(1).normal(0.0, steps / 255, picture.shape)).astype(np.float32)
    calm = without_noise(noisy)
    assert calm.shape == noisy.shape and calm.dtype == np.float32
    wall = np.s_[10:70, 10:200]
    assert np.std((calm - picture)[wall]) * 255 == pytest.approx(1.0, rel=0.2)
    walls_and_edges = np.s_[:, :210]
    left, was = (np.sqrt(np.mean((a - picture)[walls_and_edges] ** 2)) for a in (calm, noisy))
    assert left < 0.75 * was
    assert np.array_equal(calm, without_noise(noisy))

"""Patches are found where they were moved to, and only where there is one such place."""

import cv2
import numpy as np
import pytest

from r2sego_blender.generation.registration.patch_matching import RADIUS_PX, corners, match_patches


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def texture(rng, height=160, width=200):
    return cv2.GaussianBlur(rng.random((height, width), np.float32), (0, 0), 1.5) * 2.0 - 0.5


def shifted(image, dx, dy):
    """The image moved by (dx, dy) pixels, sampled smoothly."""
    moving = np.array([[1.0, 0.0, dx], [0.0, 1.0, dy]])
    return cv2.warpAffine(image, moving, image.shape[::-1], flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)


def matched(image, other, reach_px=12, ratio=0.85):
    columns, rows = corners(image, np.ones(image.shape, bool), 24)
    assert len(columns) > 5
    return match_patches(image, columns, rows, other, reach_px, 0.6, ratio), len(columns)


@pytest.mark.parametrize(("dx", "dy"), [(0.0, 0.0), (5.3, -7.6), (-10.25, 3.5)])
def test_a_shift_is_found_to_a_fraction_of_a_pixel(rng, dx, dy):
    image = texture(rng)
    found, looked_for = matched(image, 0.3 + 0.5 * shifted(image, dx, dy))  # in another light
    assert len(found.scores) > 0.8 * looked_for
    off = found.places - np.stack([found.columns, found.rows], axis=1) - 0.5 - [dx, dy]
    assert np.abs(np.median(off, axis=0)).max() < 0.05
    assert np.quantile(np.abs(off), 0.9) < 0.2


@pytest.mark.parametrize(("height", "width"), [(20, 100), (100, 20), (20, 20)])
def test_images_lower_or_narrower_than_a_cell_have_no_corners(rng, height, width):
    image = texture(rng, height, width)
    columns, rows = corners(image, np.ones(image.shape, bool), 24)
    assert len(columns) == len(rows) == 0
    assert len(match_patches(image, columns, rows, image, 12, 0.6, 0.85).scores) == 0


def test_what_moved_further_than_the_reach_is_not_found(rng):
    image = texture(rng)
    found, looked_for = matched(image, shifted(image, 25.0, 0.0))
    assert len(found.scores) < 0.1 * looked_for


def test_repeated_texture_has_no_one_place(rng):
    tile = texture(rng, 10, 10)
    image = np.tile(tile, (16, 20))
    found, _ = matched(image, shifted(image, 3.0, 2.0))
    assert len(found.scores) == 0


def test_noise_and_flat_images_match_nothing(rng):
    image = texture(rng)
    found, looked_for = matched(image, texture(rng))
    assert len(found.scores) < 0.1 * looked_for
    found, _ = matched(image, np.full_like(image, 0.5))
    assert len(found.scores) == 0


def test_corners_keep_off_what_is_unknown_and_flat(rng):
    image = texture(rng)
    image[:, 100:] = 0.5
    known = np.ones(image.shape, bool)
    known[:80] = False
    columns, rows = corners(image, known, 24)
    assert len(rows) > 3
    assert rows.min() >= 80 + RADIUS_PX
    assert rows.max() < image.shape[0] - RADIUS_PX
    assert columns.min() >= RADIUS_PX
    assert columns.max() < 108
    assert len(corners(image, np.zeros_like(known), 24)[0]) == 0


def test_an_edge_is_no_corner():
    image = np.zeros((120, 120), np.float32)
    image[:, 60:] = 1.0
    assert len(corners(image, np.ones(image.shape, bool), 24)[0]) == 0

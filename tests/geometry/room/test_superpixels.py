"""Superpixels: small, of one colour, and as a plain search chooses them."""

import numpy as np
import pytest

from r2sego_blender.geometry.room import superpixels as module
from r2sego_blender.geometry.room.superpixels import superpixels


@pytest.fixture
def picture():
    """Two colours that meet at a slanted line, each with a little noise; (60, 81, 3) CIELAB."""
    rng = np.random.default_rng(2)
    y, x = np.mgrid[:60, :81]
    left = x < 30 + 0.4 * y
    colours = np.where(left[..., None], (60.0, 40.0, 10.0), (40.0, -20.0, 30.0))
    return (colours + rng.normal(0, 1.0, colours.shape)).astype(np.float32), left


def test_patches_are_small_and_numbered_without_gaps(picture):
    colours, _ = picture
    patches = superpixels(colours, 7, 12.0)
    assert patches.shape == colours.shape[:2] and patches.dtype == np.int32
    sizes = np.bincount(patches.ravel())
    assert (sizes > 0).all() and 60 < len(sizes) <= 8 * 11
    for patch in range(len(sizes)):
        y, x = np.nonzero(patches == patch)
        assert np.ptp(y) < 5 * 7 and np.ptp(x) < 5 * 7


def test_no_patch_lies_across_an_edge(picture):
    colours, left = picture
    patches = superpixels(colours, 7, 12.0)
    on_left = np.bincount(patches.ravel(), left.ravel()) / np.bincount(patches.ravel())
    assert ((on_left == 0) | (on_left == 1)).all()


def test_each_pixel_takes_the_nearest_centre_around_it():
    rng = np.random.default_rng(5)
    rows, columns, height, width = 4, 6, 33, 50
    features = rng.normal(size=(height, width, 5)).astype(np.float32)
    centres = rng.normal(size=(rows * columns, 5)).astype(np.float32)
    found = module._nearest(features, centres, rows, columns)
    for y in range(height):
        for x in range(width):
            r, c = y * rows // height, x * columns // width
            near = [
                a * columns + b
                for a in range(max(0, r - 2), min(rows, r + 3))
                for b in range(max(0, c - 2), min(columns, c + 3))
            ]
            distances = ((features[y, x] - centres[near]) ** 2).sum(axis=1)
            assert distances[near.index(found[y, x])] == pytest.approx(distances.min(), rel=1e-5)


@pytest.mark.parametrize("shape", [(1, 1), (3, 200), (6, 6)])
def test_pictures_smaller_than_a_patch_have_patches_too(shape):
    patches = superpixels(np.zeros((*shape, 3), np.float32), 7, 12.0)
    assert patches.shape == shape and patches.min() == 0


def test_the_number_of_threads_changes_nothing(picture, with_threads):
    with_one = with_threads(1, lambda: superpixels(picture[0], 7, 12.0))
    np.testing.assert_array_equal(with_one, superpixels(picture[0], 7, 12.0))

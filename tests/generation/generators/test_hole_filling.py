"""Push-pull: known pixels stay, constants stay constant, surfaces continue themselves."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from r2sego_blender.generation.generators.hole_filling import fill_holes


def plane(height, width, depth=2.0, normal=(0.0, 0.0, -1.0)):
    v, u = np.mgrid[:height, :width].astype(np.float32)
    points = np.stack([u / width - 0.5, v / height - 0.5, np.ones_like(u)], axis=-1) * np.float32(depth)
    return points, np.broadcast_to(np.float32(normal), points.shape).copy()


masks = hnp.arrays(bool, hnp.array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=37))


@given(masks, st.integers(0, 100))
def test_known_pixels_stay_and_others_lie_between_them(known, seed):
    image = np.random.default_rng(seed).random((*known.shape, 3), np.float32)
    points, normals = plane(*known.shape)
    filled = fill_holes(image, known, points, normals)
    np.testing.assert_array_equal(filled[known], image[known])
    if known.any():
        low, high = image[known].min(axis=0), image[known].max(axis=0)
        assert (filled >= low - 1e-5).all()
        assert (filled <= high + 1e-5).all()


def test_a_constant_is_continued():
    known = np.zeros((50, 70), bool)
    known[3, 5] = known[40, 60] = True
    image = np.where(known[..., None], np.float32(0.3), np.float32(7.0)).repeat(3, axis=2)
    np.testing.assert_allclose(fill_holes(image, known, *plane(50, 70)), 0.3, atol=1e-6)


def test_a_wide_hole_goes_from_one_sides_colour_to_the_others():
    known = np.zeros((32, 256), bool)
    known[:, :16] = known[:, -16:] = True
    image = np.where(np.arange(256)[:, None] < 128, np.float32(0.2), np.float32(0.8))
    filled = fill_holes(np.broadcast_to(image, (32, 256, 3)).copy(), known, *plane(32, 256))[..., 0]
    assert np.abs(filled[:, 36] - 0.2).max() < 0.1 and np.abs(filled[:, 219] - 0.8).max() < 0.1
    assert np.abs(np.diff(filled.mean(axis=0))).max() < 0.05


def test_a_hidden_wall_is_filled_with_wall_and_not_with_what_hides_it():
    height, width = 96, 128
    wall, normals = plane(height, width, 3.0)
    table, _ = plane(height, width, 1.5)
    points = wall.copy()
    points[:, :48] = table[:, :48]
    image = np.zeros((height, width, 3), np.float32)
    image[:, :48] = [1.0, 0.0, 0.0]
    image[:, 48:] = [0.0, 0.0, 1.0]
    known = np.ones((height, width), bool)
    known[:, 48:64] = False  # the wall beside the table
    filled = fill_holes(image, known, points, normals)
    assert filled[:, 48:64, 0].max() < 0.03
    assert filled[:, 48:64, 2].min() > 0.97


def test_without_any_surface_it_is_plain_push_pull():
    known = np.ones((32, 32), bool)
    known[8:24, 8:24] = False
    image = np.full((32, 32, 3), 0.5, np.float32)
    image[~known] = 0.0
    nothing = np.zeros((32, 32, 3), np.float32)
    np.testing.assert_allclose(fill_holes(image, known, nothing, nothing), 0.5, atol=1e-6)


@pytest.mark.parametrize("value", [True, False])
def test_all_or_nothing_known_changes_nothing(value):
    image = np.random.default_rng(0).random((9, 11, 3), np.float32)
    np.testing.assert_array_equal(fill_holes(image, np.full((9, 11), value), *plane(9, 11)), image)

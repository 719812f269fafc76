from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from splat_reference import random_asset, small_camera

from r2sego_blender.core.errors import AssetError
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.quaternions import from_rotation, product, to_rotation
from r2sego_blender.splats.rendering.rasterizer import render


def similarity(seed: int, scale: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.random(random_state=seed).as_matrix() * scale
    matrix[:3, 3] = np.random.default_rng(seed).uniform(-3, 3, 3)
    return matrix


@given(seed=st.integers(0, 1000))
@settings(max_examples=15, deadline=None)
def test_moving_the_asset_with_the_camera_leaves_the_image(seed: int) -> None:
    asset, camera = random_asset(np.random.default_rng(seed)), small_camera()
    moved = similarity(seed, scale=1.0)
    before = render(asset, camera)
    after = render(asset.transformed(moved), camera.transformed(moved))
    # float32 poses move a pixel's alpha across 1/255 now and then
    assert np.quantile(np.abs(after.colour - before.colour), 0.999) < 1e-4
    assert np.abs(after.colour - before.colour).max() < 0.01


def test_scaling_the_asset_scales_its_depth() -> None:
    asset, camera = random_asset(np.random.default_rng(3)), small_camera()
    in_front = asset.subset(camera.project(asset.means)[1] > 0.5)
    moved = similarity(3, scale=2.0)
    before = render(in_front, camera)
    after = render(in_front.transformed(moved), camera.transformed(moved))
    np.testing.assert_allclose(after.depth, 2.0 * before.depth, rtol=2e-3)
    np.testing.assert_allclose(after.colour, before.colour, atol=2e-3)


def test_transforming_there_and_back_is_the_identity() -> None:
    asset = random_asset(np.random.default_rng(5))
    matrix = similarity(5, scale=1.7)
    back = asset.transformed(matrix).transformed(np.linalg.inv(matrix))
    np.testing.assert_allclose(back.means, asset.means, atol=1e-5)
    np.testing.assert_allclose(back.log_scales, asset.log_scales, atol=1e-5)
    np.testing.assert_allclose(back.sh, asset.sh, atol=1e-5)
    np.testing.assert_allclose(to_rotation(back.quaternions), to_rotation(asset.quaternions), atol=1e-5)


def test_a_zero_quaternion_turns_as_the_identity() -> None:
    asset = random_asset(np.random.default_rng(6), count=1)
    asset.quaternions[:] = 0.0
    matrix = similarity(6, scale=1.0)
    np.testing.assert_allclose(to_rotation(asset.transformed(matrix).quaternions)[0], matrix[:3, :3], atol=1e-6)


@pytest.mark.parametrize("matrix", [np.diag([1.0, 1.0, -1.0, 1.0]), np.diag([1.0, 2.0, 1.0, 1.0])])
def test_mirrors_and_uneven_scales_are_refused(matrix: np.ndarray) -> None:
    with pytest.raises(AssetError, match="similarity"):
        random_asset(np.random.default_rng(0)).transformed(matrix)


def test_concatenation_takes_the_higher_degree() -> None:
    rng = np.random.default_rng(1)
    low, high = random_asset(rng, 4, degree=0), random_asset(rng, 3, degree=2)
    both = low.concatenated(high)
    assert (len(both), both.degree) == (7, 2)
    np.testing.assert_array_equal(both.sh[:4, :1], low.sh)
    assert not both.sh[:4, 1:].any()
    np.testing.assert_array_equal(both.subset(np.arange(7) > 3).sh, high.sh)
    assert len(SplatAsset.empty().concatenated(high)) == 3


def test_shapes_that_do_not_fit_are_named() -> None:
    with pytest.raises(AssetError, match="quaternions"):
        SplatAsset(np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((2, 3)), np.zeros(2), np.zeros((2, 1, 3)))
    with pytest.raises(AssetError, match="coefficients"):
        SplatAsset(np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((2, 4)), np.zeros(2), np.zeros((2, 5, 3)))


def test_quaternion_products_compose_rotations() -> None:
    a, b = Rotation.random(5, random_state=0).as_matrix(), Rotation.random(5, random_state=1).as_matrix()
    composed = to_rotation(product(from_rotation(a), from_rotation(b)))
    np.testing.assert_allclose(composed, a @ b, atol=1e-12)

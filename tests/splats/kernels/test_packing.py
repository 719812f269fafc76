from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from splat_reference import random_asset, small_camera

from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.kernels.packing import (
    HARMONICS,
    LOG_SCALE,
    LOGIT_OPACITY,
    MEAN,
    QUATERNION,
    PackedGaussians,
    morton_order,
    pack,
    rows_of,
    unpack,
)
from r2sego_blender.splats.rendering.rasterizer import Rasterizer, render
from r2sego_blender.splats.vector_language.vectors import LANES, VECTOR_BYTES

COUNTS = (0, 1, 15, 16, 17, 1000)


def bits_of(asset: SplatAsset) -> list[bytes]:
    return [getattr(asset, field.name).tobytes() for field in dataclasses.fields(asset)]


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("width", [1, 14, 59])
def test_rows_become_lanes_and_rows_again(count: int, width: int) -> None:
    columns = np.random.default_rng(count).normal(size=(count, width)).astype(np.float32)
    chunks = pack(columns)
    assert chunks.shape == (-(-count // LANES), width, LANES)
    assert chunks.ctypes.data % VECTOR_BYTES == 0 or not count
    for i in range(0, count, 7):
        np.testing.assert_array_equal(chunks[i // LANES, :, i % LANES], columns[i])
    assert not unpack(chunks, len(chunks) * LANES)[count:].any()
    np.testing.assert_array_equal(unpack(chunks, count), columns)


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("degree", range(4))
def test_an_asset_comes_back_bit_for_bit(count: int, degree: int) -> None:
    asset = random_asset(np.random.default_rng(count), count, degree)
    if count:
        asset.means[0] = np.nan, np.inf, -0.0
        asset.sh[-1, 0] = 1e-42, -np.inf, 3e38
        asset.logit_opacities[-1] = np.nan
    packed = PackedGaussians.of(asset)
    assert len(packed) == count
    assert packed.coefficients == (degree + 1) ** 2
    assert packed.values.shape[1] == rows_of(packed.coefficients)
    assert bits_of(packed.asset()) == bits_of(asset)


def test_each_place_holds_the_gaussian_of_its_order() -> None:
    asset = random_asset(np.random.default_rng(0), 50)
    packed = PackedGaussians.of(asset)
    for place, number in enumerate(packed.order):
        column = packed.values[place // LANES, :, place % LANES]
        np.testing.assert_array_equal(column[MEAN:LOG_SCALE], asset.means[number])
        np.testing.assert_array_equal(column[LOG_SCALE:QUATERNION], asset.log_scales[number])
        np.testing.assert_array_equal(column[QUATERNION:LOGIT_OPACITY], asset.quaternions[number])
        assert column[LOGIT_OPACITY] == asset.logit_opacities[number]
        np.testing.assert_array_equal(column[HARMONICS:].reshape(-1, 3), asset.sh[number])


@pytest.mark.parametrize("count", [1, 15, 17])
def test_places_after_the_last_gaussian_are_never_drawn(count: int) -> None:
    """They lie at the world's origin, here in the middle of the image."""
    camera, rasterizer = small_camera(), Rasterizer()
    behind = SplatAsset(
        means=np.tile(camera.centre - camera.forward, (count, 1)),
        log_scales=np.zeros((count, 3)),
        quaternions=np.ones((count, 4)),
        logit_opacities=np.full(count, 9.0),
        sh=np.ones((count, 1, 3)),
    )
    pixel, depth = camera.project(np.zeros((1, 3)))
    assert camera.sees(pixel, depth).all()
    rasterizer.forward(PackedGaussians.of(behind), camera)
    assert (rasterizer.transmittance == 1.0).all()
    assert not rasterizer.colour.any()


@given(hnp.arrays(np.float32, st.tuples(st.integers(0, 40), st.just(3)), elements=st.floats(width=32)))
def test_the_order_along_the_curve_is_a_permutation_of_any_points(points: np.ndarray) -> None:
    order = morton_order(points)
    assert order.dtype == np.int64
    np.testing.assert_array_equal(np.sort(order), np.arange(len(points)))


def test_neighbours_in_space_stand_in_one_chunk() -> None:
    points = np.random.default_rng(0).uniform(size=(4096, 3))
    points[7] = 1e9  # a stray one must not squeeze the others into one cell
    points[9] = np.nan

    def spread(order: np.ndarray) -> float:
        chunks = points[order].reshape(-1, LANES, 3)
        size = np.ptp(chunks, axis=1).max(axis=1)
        return float(np.nanmedian(size))

    # Sixteen of 4096 even points fill a cube with a side of 0.16.
    assert spread(morton_order(points)) < 0.35 < 0.8 < spread(np.arange(len(points)))


def test_the_same_points_keep_their_order() -> None:
    np.testing.assert_array_equal(morton_order(np.zeros((20, 3))), np.arange(20))
    np.testing.assert_array_equal(morton_order(np.full((20, 3), np.nan)), np.arange(20))


@pytest.mark.parametrize("count", [0, 5, 16, 33])
def test_room_for_more_is_not_in_use(count: int) -> None:
    asset, camera = random_asset(np.random.default_rng(1), count), small_camera()
    tight, roomy = PackedGaussians.of(asset), PackedGaussians.of(asset, capacity=100)
    assert len(roomy) == count and len(roomy.chunks) * LANES >= 100
    assert roomy.chunks.ctypes.data % VECTOR_BYTES == 0
    np.testing.assert_array_equal(roomy.values, tight.values)
    assert bits_of(roomy.asset()) == bits_of(asset)
    rasterizer = Rasterizer()
    rasterizer.forward(roomy, camera)
    np.testing.assert_array_equal(rasterizer.colour, render(asset, camera).colour)

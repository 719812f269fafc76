"""Every n-th pixel of an image stands for the image."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from photometric import photometric_loss

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.splats.kernels.packing import PackedGaussians
from r2sego_blender.splats.rendering.rasterizer import Rasterizer
from r2sego_blender.splats.training.lattice import Lattice
from tests.splats.splat_reference import random_asset

CAMERA = Camera(
    61, 44, 50.0, 52.0, 28.0, 23.0, look_at(np.array([0.1, -0.2, -1.0]), (0.0, 0.0, 2.0), up=(0.0, -1.0, 0.0))
)
LATTICES = st.integers(1, 5).flatmap(
    lambda stride: st.builds(Lattice, st.just(stride), st.integers(0, stride - 1), st.integers(0, stride - 1))
)


def all_of(stride: int) -> list[Lattice]:
    return [Lattice(stride, *place) for place in itertools.product(range(stride), repeat=2)]


@settings(deadline=None, derandomize=True)
@given(LATTICES)
def test_its_cameras_rays_are_those_of_its_pixels(lattice: Lattice) -> None:
    camera = lattice.camera(CAMERA)
    np.testing.assert_array_equal(camera.world_from_camera, CAMERA.world_from_camera)
    np.testing.assert_allclose(camera.rays(), lattice.pixels(CAMERA.rays()), atol=1e-12)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(LATTICES, st.integers(0, 5))
def test_what_is_rendered_for_it_are_the_whole_renderings_pixels(lattice: Lattice, seed: int) -> None:
    """Of Gaussians near what the camera sees: those held at a bound outside it are held elsewhere."""
    rng = np.random.default_rng(seed)
    asset = random_asset(rng)
    asset.means[:] = rng.uniform([-0.4, -0.35, 1.0], [0.4, 0.35, 3.0], asset.means.shape)
    packed, rasterizer = PackedGaussians.of(asset), Rasterizer()
    rasterizer.forward(packed, CAMERA)
    whole = rasterizer.rendering()
    rasterizer.forward(packed, lattice.camera(CAMERA), dilation_px2=lattice.dilation_px2)
    some = rasterizer.rendering()
    np.testing.assert_allclose(some.colour, lattice.pixels(whole.colour), atol=1e-5)
    np.testing.assert_allclose(some.alpha, lattice.pixels(whole.alpha), atol=1e-5)


@pytest.mark.parametrize("stride", [1, 2, 3])
def test_those_of_a_stride_are_the_image_each_pixel_once(stride: int) -> None:
    times = np.zeros(CAMERA.shape, int)
    for lattice in all_of(stride):
        lattice.pixels(times)[...] += 1
    assert (times == 1).all()


@pytest.mark.parametrize("stride", [2, 3])
def test_the_mean_of_their_losses_has_the_whole_losss_gradient(stride: int) -> None:
    """Of the absolute differences: similarity is a matter of neighbours, which lie further apart."""
    rng = np.random.default_rng(0)
    image, truth = (rng.random((6 * 7, 6 * 9, 3)).astype(np.float32) for _ in range(2))
    _, expected = photometric_loss(image, truth, 0.0)
    mean = np.zeros_like(expected)
    for lattice in all_of(stride):
        _, gradient = photometric_loss(lattice.pixels(image).copy(), lattice.pixels(truth).copy(), 0.0)
        lattice.pixels(mean)[...] += gradient / stride**2
    np.testing.assert_allclose(mean, expected, rtol=1e-5)


def test_each_is_drawn_as_often_and_none_where_there_is_but_one() -> None:
    rng = np.random.default_rng(0)
    drawn = [Lattice.drawn(3, CAMERA.shape, rng) for _ in range(1800)]
    times = [drawn.count(lattice) for lattice in all_of(3)]
    assert sum(times) == 1800 and min(times) > 140 and max(times) < 260
    before = rng.bit_generator.state
    assert Lattice.drawn(1, CAMERA.shape, rng) == Lattice() and rng.bit_generator.state == before
    assert Lattice().camera(CAMERA) is CAMERA


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (2, 2)])
def test_a_lattice_of_the_smallest_images_has_pixels(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        lattice = Lattice.drawn(3, shape, rng)
        assert lattice.pixels(np.zeros(shape)).size > 0
        height, width = shape
        small = lattice.camera(Camera(width, height, 9.0, 9.0, 1.0, 1.0, np.eye(4)))
        assert small.shape == lattice.pixels(np.zeros(shape)).shape

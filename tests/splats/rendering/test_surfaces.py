"""Opaque surfaces among Gaussians: what stands before them equals the plain float64 sum, pixel by Gaussian."""

from __future__ import annotations

import numpy as np
import torch
from hypothesis import assume, given, settings
from splat_reference import alphas, frozen, on_screen, random_asset, scenes, small_camera, weights

from r2sego_blender.core.cameras import Camera
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.kernels.packing import PackedGaussians
from r2sego_blender.splats.rendering.rasterizer import Rasterizer
from r2sego_blender.splats.rendering.surfaces import in_front

SURFACES_M = (0.0, 1.0, 2.5, 1e9)
"""Of a quarter of the pixels each: none, near, in the middle of the asset, behind all of it."""


def drawn(asset: SplatAsset, camera: Camera) -> Rasterizer:
    rasterizer = Rasterizer()
    rasterizer.forward(PackedGaussians.of(asset), camera)
    return rasterizer


def surfaces(camera: Camera) -> np.ndarray:
    return np.random.default_rng(0).choice(SURFACES_M, camera.shape).astype(np.float32)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(scenes(most=30, largest_px=50))
def test_what_stands_before_a_surface_equals_brute_force(scene: tuple[SplatAsset, Camera]) -> None:
    asset, camera = scene
    surface_m = surfaces(camera)
    screen = on_screen(*frozen(asset), camera)
    blended, _ = weights(screen, camera)
    alpha = alphas(screen, camera)
    assume(not ((255.0 * alpha - 1.0).abs() < 1e-3).any())  # rounding decides whether it is seen
    assume(not any(((screen.depth - at).abs() < 1e-4).any() for at in SURFACES_M))
    nearer = screen.depth[:, None, None] < torch.tensor(surface_m)
    blended = blended * nearer
    seen = surface_m > 0.0
    found = in_front(drawn(asset, camera).tile_entries, surface_m)
    colour = torch.einsum("nhw,nc->hwc", blended, screen.colour).numpy()
    depth = torch.einsum("nhw,n->hw", blended, screen.depth).numpy()
    light = np.where(seen, 1.0 - blended.sum(0).numpy(), 0.0)
    np.testing.assert_allclose(found.colour, colour, atol=2e-3 * max(1.0, colour.max(initial=0.0)))
    np.testing.assert_allclose(found.depth_sum, depth, atol=2e-3 * max(1.0, depth.max(initial=0.0)))
    np.testing.assert_allclose(found.transmittance, light, atol=2e-3)


@settings(max_examples=10, deadline=None, derandomize=True)
@given(scenes(most=30, largest_px=50))
def test_before_a_surface_behind_everything_stands_the_whole_image(scene: tuple[SplatAsset, Camera]) -> None:
    asset, camera = scene
    rasterizer = drawn(asset, camera)
    found = in_front(rasterizer.tile_entries, np.full(camera.shape, np.inf, np.float32))
    np.testing.assert_allclose(found.colour, rasterizer.colour, rtol=1e-3, atol=2e-3)
    np.testing.assert_allclose(found.transmittance, rasterizer.transmittance, atol=2e-3)


def test_no_thread_changes_a_bit(with_threads) -> None:
    rng = np.random.default_rng(1)
    asset, camera = random_asset(rng), small_camera()
    one, two = (
        with_threads(count, lambda: in_front(drawn(asset, camera).tile_entries, surfaces(camera))) for count in (1, 2)
    )
    for name in ("colour", "depth_sum", "transmittance"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))

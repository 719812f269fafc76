from __future__ import annotations

import numpy as np
import pytest
import torch
from splat_reference import parameters, random_asset, rasterize, small_camera

from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import AssetError
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.kernels.packing import PackedGaussians
from r2sego_blender.splats.kernels.tiles import planes_of
from r2sego_blender.splats.rendering.rasterizer import Gradients, Rasterizer, render

BACKGROUND = (0.2, 0.5, 0.3)
GROUPS = ("means", "log_scales", "quaternions", "logit_opacities", "sh")


def gradients_of(asset: SplatAsset, camera: Camera, g_colour, g_alpha, g_depth) -> Gradients:
    rasterizer = Rasterizer()
    rasterizer.forward(PackedGaussians.of(asset), camera, BACKGROUND)
    return rasterizer.backward(g_colour, g_alpha, g_depth)


def image_gradients(camera: Camera, seed: int) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    shapes = ((*camera.shape, 3), camera.shape, camera.shape)
    return tuple(rng.normal(size=shape).astype(np.float32) for shape in shapes)


@pytest.mark.parametrize("seed", range(6))
def test_images_equal_the_reference(seed: int) -> None:
    asset, camera = random_asset(np.random.default_rng(seed), degree=seed % 4), small_camera()
    with torch.no_grad():
        colour, alpha, depth_sum = rasterize(*parameters(asset), camera, BACKGROUND)
    result = render(asset, camera, BACKGROUND)
    np.testing.assert_allclose(result.colour, colour, atol=1e-5)
    np.testing.assert_allclose(result.alpha, alpha, atol=1e-5)
    seen = alpha.numpy() > 0.01
    np.testing.assert_allclose(result.depth[seen], (depth_sum / alpha).numpy()[seen], rtol=1e-4)


@pytest.mark.parametrize("seed", range(6))
def test_gradients_equal_the_reference_in_every_group(seed: int) -> None:
    asset, camera = random_asset(np.random.default_rng(seed), degree=seed % 4), small_camera()
    upstream = image_gradients(camera, seed)
    leaves = parameters(asset)
    results = rasterize(*leaves, camera, BACKGROUND)
    sum((result * torch.from_numpy(g)).sum() for result, g in zip(results, upstream, strict=True)).backward()
    ours = gradients_of(asset, camera, *upstream)
    for name, leaf in zip(GROUPS, leaves, strict=True):
        expected = leaf.grad.numpy()
        error = np.linalg.norm(getattr(ours, name) - expected) / np.linalg.norm(expected)
        assert error < 1e-4, name


def test_the_same_bits_for_every_run_and_number_of_threads(with_threads) -> None:
    asset, camera = random_asset(np.random.default_rng(9), count=3000), small_camera(160, 120)
    upstream = image_gradients(camera, 0)

    def results() -> list[np.ndarray]:
        gradients = gradients_of(asset, camera, *upstream)
        image = render(asset, camera, BACKGROUND)
        return [image.colour, image.depth, *(getattr(gradients, name) for name in GROUPS)]

    with_one = with_threads(1, results)
    for with_all in (results(), results()):
        assert all(a.tobytes() == b.tobytes() for a, b in zip(with_one, with_all, strict=True))


def test_degenerate_gaussians_do_no_harm() -> None:
    asset, camera = random_asset(np.random.default_rng(2), count=12), small_camera()
    asset.quaternions[0] = 0.0
    asset.quaternions[1] = 1e-25
    asset.logit_opacities[2] = -1e4
    asset.logit_opacities[3] = 1e4
    asset.log_scales[4] = -90.0
    asset.log_scales[5] = 60.0
    asset.means[6] = camera.centre
    asset.means[7] = camera.centre - camera.forward
    asset.means[8] = np.nan
    asset.means[9] = 1e30
    asset.sh[10] = np.nan
    asset.means[10] = camera.centre - camera.forward
    gradients = gradients_of(asset, camera, *image_gradients(camera, 1))
    image = render(asset, camera)
    assert all(np.isfinite(a).all() for a in (image.colour, image.alpha, image.depth))
    assert all(np.isfinite(getattr(gradients, name)).all() for name in GROUPS)
    for name in GROUPS:
        assert not getattr(gradients, name)[[2, 6, 7, 8, 9, 10]].any()


def test_an_opaque_wall_has_its_colour_and_depth() -> None:
    grid = np.stack(np.meshgrid(np.arange(-2, 2, 0.05), np.arange(-2, 2, 0.05)), -1).reshape(-1, 2)
    count = len(grid)
    asset = SplatAsset(
        means=np.column_stack([grid, np.full(count, 2.0)]),
        log_scales=np.tile(np.log([0.05, 0.05, 1e-4]), (count, 1)),
        quaternions=np.tile([1.0, 0, 0, 0], (count, 1)),
        logit_opacities=np.full(count, 6.0),
        sh=np.full((count, 1, 3), (0.75 - 0.5) / 0.28209479),
    )
    image = render(asset, Camera(50, 40, 40.0, 40.0, 25.0, 20.0, np.eye(4)))
    assert image.alpha.min() > 0.999
    expected = np.broadcast_to(0.75 * image.alpha[..., None], image.colour.shape)
    np.testing.assert_allclose(image.colour, expected, rtol=1e-4)
    np.testing.assert_allclose(image.depth, 2.0, rtol=1e-4)


def test_no_gaussian_shows_the_background() -> None:
    image = render(SplatAsset.empty(3), small_camera(), BACKGROUND)
    np.testing.assert_array_equal(image.colour, np.broadcast_to(np.float32(BACKGROUND), image.colour.shape))
    assert not image.alpha.any()
    assert not image.depth.any()


def test_an_image_behind_the_gaussians_is_a_background() -> None:
    asset, camera = random_asset(np.random.default_rng(3)), small_camera()
    behind = np.random.default_rng(4).random((*camera.shape, 3)).astype(np.float32)
    over_black, over_image = render(asset, camera), render(asset, camera, behind)
    expected = over_black.colour + (1.0 - over_black.alpha)[..., None] * behind
    np.testing.assert_allclose(over_image.colour, expected, atol=1e-6)
    # Its planes do as well, wherever they stand in memory.
    planes = planes_of(behind)
    elsewhere = np.empty(planes.size + 1, np.float32)[1:].reshape(planes.shape)
    elsewhere[:] = planes
    for same in (planes, elsewhere):
        np.testing.assert_array_equal(render(asset, camera, same).colour, over_image.colour)

    leaves, upstream = parameters(asset), image_gradients(camera, 5)
    results = rasterize(*leaves, camera, behind)
    sum((result * torch.from_numpy(g)).sum() for result, g in zip(results, upstream, strict=True)).backward()
    rasterizer = Rasterizer()
    rasterizer.forward(PackedGaussians.of(asset), camera, behind)
    ours = rasterizer.backward(*upstream)
    for name, leaf in zip(GROUPS, leaves, strict=True):
        error = np.linalg.norm(getattr(ours, name) - leaf.grad.numpy()) / np.linalg.norm(leaf.grad.numpy())
        assert error < 1e-4, name


def test_a_background_of_another_size_is_refused() -> None:
    with pytest.raises(AssetError, match=r"background has the shape \(2, 2, 3\)"):
        render(SplatAsset.empty(), small_camera(), np.zeros((2, 2, 3)))


def test_buffers_serve_images_and_assets_of_changing_size() -> None:
    rng = np.random.default_rng(4)
    for count, width in ((50, 45), (500, 30), (7, 101), (50, 45)):
        asset, camera = random_asset(rng, count), small_camera(width, 40)
        fresh = Rasterizer()
        fresh.forward(PackedGaussians.of(asset), camera)
        np.testing.assert_array_equal(render(asset, camera).colour, fresh.colour)


def test_a_lower_degree_ignores_the_higher_harmonics() -> None:
    asset, camera = random_asset(np.random.default_rng(8)), small_camera()
    rasterizer = Rasterizer()
    rasterizer.forward(PackedGaussians.of(asset), camera, degree=1)
    np.testing.assert_array_equal(rasterizer.colour, render(asset.with_degree(1), camera).colour)

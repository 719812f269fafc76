"""Alpha alone against the rasteriser's, and the deficit against a count of its pixels."""

import numpy as np
import pytest

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.kernels.projection import DILATION_PX2
from r2sego_blender.splats.rendering.rasterizer import render
from r2sego_blender.views.scoring.deficit import AlphaRenderer

LENS = Camera(94, 67, 70.0, 72.0, 46.0, 35.5, np.eye(4))


def random_asset(rng, count=1500, size=0.04):
    return SplatAsset(
        means=rng.uniform(-2.0, 2.0, (count, 3)),
        log_scales=np.log(size) + rng.normal(0.0, 0.7, (count, 3)),
        quaternions=rng.normal(size=(count, 4)),
        logit_opacities=rng.normal(0.0, 2.0, count),
        sh=rng.normal(size=(count, 4, 3)),
    )


def random_cameras(rng, count, lens=LENS):
    return [lens.at(look_at(rng.uniform(-2.0, 2.0, 3), rng.uniform(-0.5, 0.5, 3))) for _ in range(count)]


@pytest.fixture(scope="module")
def views():
    rng = np.random.default_rng(0)
    asset = random_asset(rng)
    cameras = random_cameras(rng, 9)
    return asset, cameras, np.stack([render(asset, camera).alpha for camera in cameras])


def test_alpha_is_the_rasterisers(views):
    asset, cameras, expected = views
    alpha = AlphaRenderer(asset).alphas(cameras)
    assert alpha.shape == expected.shape
    assert 0.1 < (expected < 0.8).mean() < 0.9
    # The rasteriser leaves a pixel whose transmittance is 1e-4; here every Gaussian counts.
    full = 1.0 - 1e-4
    different = np.abs(np.minimum(alpha, full) - np.minimum(expected, full)) > 1e-5
    # Where a Gaussian's alpha is 1/255 but for rounding, one of the two may leave it out.
    assert different.mean() < 1e-4
    assert np.abs(alpha - expected).max() < 0.005


@pytest.mark.parametrize("threshold", [0.05, 0.5, 0.8, 0.99])
def test_the_deficit_is_the_share_of_pixels_below_the_threshold(views, threshold):
    asset, cameras, _ = views
    renderer = AlphaRenderer(asset)
    expected = (renderer.alphas(cameras) < np.float32(threshold)).mean(axis=(1, 2))
    np.testing.assert_array_equal(renderer.missing_shares(cameras, threshold), expected)


def test_fewer_pixels_are_a_sample_of_the_full_image(views):
    """At a third, the dilation a ninth, a pixel's alpha is that of the middle of the nine."""
    asset, _, _ = views
    small = [camera.scaled(1.0 / 3.0) for camera in random_cameras(np.random.default_rng(1), 3, LENS.scaled(3))]
    large = [camera.scaled(3.0) for camera in small]
    renderer = AlphaRenderer(asset)
    sampled = renderer.alphas(small, DILATION_PX2 / 9.0)
    whole = renderer.alphas(large)[:, 1::3, 1::3]
    assert (np.abs(sampled - whole) < 1e-4).mean() > 0.999


def test_the_bits_do_not_depend_on_the_threads(views, with_threads):
    asset, cameras, _ = views
    renderer = AlphaRenderer(asset)
    with_all = renderer.missing_shares(cameras, 0.8)
    with_one = with_threads(1, lambda: renderer.missing_shares(cameras, 0.8))
    np.testing.assert_array_equal(with_one, with_all)


def test_each_view_alone_scores_as_among_others(views):
    asset, cameras, _ = views
    renderer = AlphaRenderer(asset)
    alone = [renderer.missing_shares([camera], 0.8)[0] for camera in cameras]
    np.testing.assert_array_equal(alone, renderer.missing_shares(cameras, 0.8))


def test_an_empty_asset_misses_everything():
    empty = random_asset(np.random.default_rng(0), 0)
    assert AlphaRenderer(empty).missing_shares([LENS], 0.8).tolist() == [1.0]
    assert AlphaRenderer(empty).missing_shares([], 0.8).tolist() == []


def test_gaussians_that_are_no_numbers_are_not_drawn(views):
    asset, cameras, _ = views
    broken = asset.copy()
    broken.means[::7] = np.nan
    broken.log_scales[1::7, 1] = np.inf
    broken.logit_opacities[2::7] = np.nan
    expected = np.stack([render(broken, camera).alpha for camera in cameras])
    alpha = AlphaRenderer(broken).alphas(cameras)
    assert np.isfinite(alpha).all()
    assert (np.abs(alpha - expected) > 2e-4).mean() < 1e-4


def test_views_of_several_sizes_are_refused(views):
    with pytest.raises(ValueError, match="one size"):
        AlphaRenderer(views[0]).alphas([LENS, LENS.scaled(0.5)])

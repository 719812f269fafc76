from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from splat_reference import random_asset, small_camera

from r2sego_blender.config.presets import EVERY_PIXEL, UNREGULARISED
from r2sego_blender.config.settings import TrainingSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import AssetError
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.kernels.adam import AdamState
from r2sego_blender.splats.kernels.packing import PackedGaussians
from r2sego_blender.splats.metrics import psnr
from r2sego_blender.splats.rendering.rasterizer import Rasterizer, render
from r2sego_blender.splats.training.lattice import Lattice
from r2sego_blender.splats.training.observations import Observation, Targets
from r2sego_blender.splats.training.training import train

GROUPS = ("means", "log_scales", "quaternions", "logit_opacities", "sh")
SETTINGS = dataclasses.replace(TrainingSettings(**UNREGULARISED), sh_degree=1)


def cameras(count: int, size: tuple[int, int] = (64, 48)) -> list[Camera]:
    width, height = size
    poses = [look_at([x, -0.2, -1.5], [0.0, 0.0, 2.0]) for x in np.linspace(-0.8, 0.8, count)]
    return [Camera(width, height, width, width, width / 2, height / 2, pose) for pose in poses]


def scene() -> tuple[SplatAsset, SplatAsset, list[Observation]]:
    """A true asset, a worse one to start from, and the images of the true one."""
    rng = np.random.default_rng(0)
    true = random_asset(rng, 200, degree=1)
    start = true.with_degree(0).copy()
    start.means[:] += rng.normal(scale=0.03, size=start.means.shape)
    start.sh[:] += rng.normal(scale=0.5, size=start.sh.shape)
    views = [Observation(c, np.clip(render(true, c).colour, 0, 1)) for c in cameras(5)]
    return true, start, views


def quality(asset: SplatAsset, views: list[Observation]) -> float:
    return float(np.mean([psnr(np.clip(render(asset, v.camera).colour, 0, 1), v.image) for v in views]))


def rates(settings: dict[str, float]) -> np.ndarray:
    """Learning rates of the packed rows of a degree-3 asset by the groups' names."""
    widths = dict(zip(GROUPS, (3, 3, 4, 1, 48), strict=True))
    return np.concatenate([np.full(widths[name], settings[name], np.float32) for name in GROUPS])


def test_a_step_is_one_of_torchs_adam() -> None:
    asset, camera = random_asset(np.random.default_rng(0), 30), cameras(1)[0]
    rate = dict(zip(GROUPS, (1e-4, 5e-3, 1e-3, 5e-2, 2.5e-3), strict=True))
    packed, rasterizer = PackedGaussians.of(asset), Rasterizer()
    state = AdamState.of(packed)
    leaves = [torch.tensor(getattr(asset, name), dtype=torch.float64) for name in GROUPS]
    reference = torch.optim.Adam(
        [{"params": [leaf], "lr": rate[name]} for name, leaf in zip(GROUPS, leaves, strict=True)], eps=1e-15
    )
    rng = np.random.default_rng(1)
    for _ in range(8):
        upstream = rng.normal(size=(*camera.shape, 3)).astype(np.float32)
        rasterizer.forward(packed, camera)
        gradients = rasterizer.backward(upstream)
        rasterizer.step(state, rates(rate))
        seen = torch.tensor(gradients.logit_opacities != 0.0)
        before = [leaf.clone() for leaf in leaves]
        for name, leaf in zip(GROUPS, leaves, strict=True):
            leaf.grad = torch.tensor(getattr(gradients, name), dtype=torch.float64)
        reference.step()
        assert seen.sum() >= 10
        moved = packed.asset()
        for name, leaf, old in zip(GROUPS, leaves, before, strict=True):
            ours = getattr(moved, name)
            np.testing.assert_allclose(ours[seen], leaf[seen], atol=3e-5)
            np.testing.assert_allclose(ours[~seen], old[~seen], atol=3e-5)
            # The paths part where rounding decides; the next step starts from ours.
            leaf.copy_(torch.tensor(ours, dtype=torch.float64))


def test_a_step_leaves_higher_harmonics_and_what_is_not_seen() -> None:
    asset, camera = random_asset(np.random.default_rng(0), 30), cameras(1)[0]
    packed, rasterizer = PackedGaussians.of(asset), Rasterizer()
    rasterizer.forward(packed, camera, degree=1)
    gradients = rasterizer.backward(np.ones((*camera.shape, 3), np.float32))
    rasterizer.step(AdamState.of(packed), rates(dict.fromkeys(GROUPS, 0.01)))
    moved = packed.asset()
    hidden = gradients.logit_opacities == 0.0
    assert hidden.any() and not hidden.all()
    for name in GROUPS:
        np.testing.assert_array_equal(getattr(moved, name)[hidden], getattr(asset, name)[hidden])
    np.testing.assert_array_equal(moved.sh[:, 4:], asset.sh[:, 4:])
    assert (moved.sh[~hidden, :4] != asset.sh[~hidden, :4]).any()


def test_training_reproduces_the_images() -> None:
    _, start, views = scene()
    trained = train(start, views, 300, SETTINGS, np.random.default_rng(0))
    assert quality(trained, views) > quality(start, views) + 8.0
    assert trained.degree == 1
    assert trained.sh[:, 1:].any()


def test_the_input_is_not_changed() -> None:
    _, start, views = scene()
    before = start.copy()
    train(start, views, 5, dataclasses.replace(SETTINGS, sh_degree=0), np.random.default_rng(0))
    for name in GROUPS:
        np.testing.assert_array_equal(getattr(start, name), getattr(before, name))


def test_the_same_seed_gives_the_same_bits_for_any_number_of_threads(with_threads) -> None:
    _, start, views = scene()

    def trained() -> SplatAsset:
        return train(start, views, 40, SETTINGS, np.random.default_rng(7))

    with_one = with_threads(1, trained)
    for with_all in (trained(), trained()):
        assert same_bits(with_one, with_all)


def test_pixels_without_confidence_teach_nothing() -> None:
    _, start, views = scene()
    spoilt = []
    for view in views:
        image, confidence = view.image.copy(), np.ones(view.camera.shape, np.float32)
        # eleven rows more: a pixel's gradient sees two windows of SSIM
        image[:20], confidence[:31] = 1.0, 0.0
        spoilt.append(dataclasses.replace(view, image=image, confidence=confidence))
    full = dataclasses.replace(SETTINGS, **EVERY_PIXEL)
    clean = [dataclasses.replace(v, confidence=s.confidence) for v, s in zip(views, spoilt, strict=True)]
    a = train(start, spoilt, 20, full, np.random.default_rng(0))
    b = train(start, clean, 20, full, np.random.default_rng(0))
    for name in GROUPS:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


def test_an_observation_is_drawn_as_often_as_it_says() -> None:
    from r2sego_blender.splats.training.training import _shuffled

    _, _, views = scene()
    views = [dataclasses.replace(views[0], draws=3), views[1]]
    stream = _shuffled(views, np.random.default_rng(0))
    drawn = np.array([next(stream) for _ in range(40)]).reshape(10, 4)
    assert ((drawn == 0).sum(axis=1) == 3).all()


@given(st.lists(st.floats(0.01, 3.0), max_size=8), st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_an_observation_is_drawn_a_fraction_of_a_time_on_average_and_evenly(fractions: list[float], seed: int) -> None:
    """One of a whole draw marks the passes: after any number of them each has come within one of its share."""
    from r2sego_blender.splats.training.training import _shuffled

    _, _, views = scene()
    many = [dataclasses.replace(views[0], draws=draws) for draws in (1.0, *fractions)]
    passes, counts = 0, np.zeros(len(many), int)
    stream = _shuffled(many, np.random.default_rng(seed))
    while passes < 30:
        index = next(stream)
        counts[index] += 1
        passes += index == 0
    # A pass may be cut off at the marker, or go on behind it: one pass more or less.
    apart = counts[1:] - passes * np.array(fractions)
    assert (np.abs(apart) <= 1.0 + np.array(fractions)).all()


@pytest.mark.parametrize("draws", [0.0, -1.0, math.inf, math.nan])
def test_an_observation_that_never_comes_is_refused(draws: float) -> None:
    _, _, views = scene()
    with pytest.raises(AssetError):
        dataclasses.replace(views[0], draws=draws)


def test_rates_swing_around_what_is_set_and_the_means_decay_besides() -> None:
    from r2sego_blender.splats.training.training import _Schedule

    settings = dataclasses.replace(SETTINGS, position_decay=0.04, learning_rate_annealing=1.0)
    first, middle = (_Schedule(settings, 100, 0, 2.0).at(step).rates for step in (0, 50))
    assert first[0] == np.float32(2.0 * settings.position_learning_rate)
    np.testing.assert_allclose(middle / first, [0.2] * 3 + [1.0] * (len(first) - 3), rtol=1e-5)
    swinging = _Schedule(dataclasses.replace(settings, learning_rate_annealing=3.0), 100, 0, 2.0)
    np.testing.assert_allclose(swinging.at(0).rates, 3.0 * first, rtol=1e-5)
    np.testing.assert_allclose(swinging.at(50).rates, middle, rtol=1e-5)
    assert swinging.at(100).rates[-1] == pytest.approx(first[-1] / 3.0)


@pytest.mark.parametrize(("cache_mb", "loads"), [(64, 5), (16, 15)])
def test_images_are_kept_up_to_the_memory_that_is_set(cache_mb: int, loads: int) -> None:
    """Five of 3.7 MB in 8 bits, each drawn three times."""
    _, start, _ = scene()
    loaded = []

    def view(camera: Camera) -> Observation:
        def image() -> np.ndarray:
            loaded.append(camera)
            return np.zeros((*camera.shape, 3), np.float32)

        return Observation(camera, image)

    settings = dataclasses.replace(SETTINGS, image_cache_mb=cache_mb, **EVERY_PIXEL)
    views = [view(camera) for camera in cameras(5, (1280, 960))]
    train(start.subset(np.arange(5)), views, 15, settings, np.random.default_rng(0))
    assert (len(loaded) == loads) if loads == 5 else (5 < len(loaded) <= loads)


def test_training_goes_on_at_the_degree_reached() -> None:
    true, _, views = scene()
    trained = train(true, views, 1, SETTINGS, np.random.default_rng(0))
    assert quality(trained, views) > 40.0


def test_what_cannot_be_trained_is_refused() -> None:
    _, start, views = scene()
    with pytest.raises(AssetError, match="no observation"):
        train(start, [], 1, SETTINGS, np.random.default_rng(0))
    with pytest.raises(AssetError, match="more than 100"):
        train(start, views, 1, dataclasses.replace(SETTINGS, max_gaussians=100), np.random.default_rng(0))
    with pytest.raises(AssetError, match="shape"):
        Observation(small_camera(), np.zeros((3, 3, 3), np.float32))


def test_what_stands_behind_is_not_painted() -> None:
    """An image that is all background leaves Gaussians transparent, not coloured like it."""
    _, start, views = scene()
    behind = np.random.default_rng(1).random(views[0].image.shape).astype(np.float32)
    lit = [dataclasses.replace(v, image=behind, background=behind) for v in views]
    trained = train(start, lit, 300, SETTINGS, np.random.default_rng(0))
    assert render(trained, views[2].camera).alpha.mean() < 0.2 * render(start, views[2].camera).alpha.mean()


def test_a_known_surface_becomes_opaque_though_its_background_has_its_colour() -> None:
    _, start, views = scene()
    weak = dataclasses.replace(start, logit_opacities=np.full(len(start), -1.0))
    same = [dataclasses.replace(v, background=v.image) for v in views]
    opaque = [dataclasses.replace(v, opaque=np.ones(v.camera.shape, np.float32)) for v in same]
    settings = dataclasses.replace(SETTINGS, opaque_weight=0.1)
    alphas = [
        render(train(weak, seen, 200, settings, np.random.default_rng(0)), views[2].camera).alpha.mean()
        for seen in (same, opaque)
    ]
    assert alphas[1] > alphas[0] + 0.1


def test_training_is_watched_and_ends_when_the_watcher_says() -> None:
    _, start, views = scene()
    seen = []

    def watch(step: int, gaussians: Callable[[], PackedGaussians]) -> bool:
        seen.append((step, len(gaussians())))
        return step == 7

    ended = train(start, views, 50, SETTINGS, np.random.default_rng(0), watch=watch)
    assert seen == [(step, len(start)) for step in range(1, 8)]
    assert (ended.means != start.means).any()


def same_bits(a: SplatAsset, b: SplatAsset) -> bool:
    return all(getattr(a, name).tobytes() == getattr(b, name).tobytes() for name in GROUPS)


def test_no_gaussian_is_larger_than_the_limit() -> None:
    _, start, views = scene()
    assert np.exp(start.log_scales.max()) > 0.4
    limited = dataclasses.replace(SETTINGS, max_scale_m=0.1)
    trained = train(start, views, 60, limited, np.random.default_rng(0))
    np.testing.assert_array_less(trained.log_scales, np.log(0.1) + 1e-6)
    assert (trained.log_scales > np.log(0.1) - 1e-6).any()
    # a limit that none reaches changes nothing
    far, none = (
        train(start, views, 20, dataclasses.replace(SETTINGS, max_scale_m=limit_m), np.random.default_rng(0))
        for limit_m in (1e3, 0.0)
    )
    assert same_bits(far, none)
    assert none.log_scales.max() > np.log(0.4)


def test_without_dropout_only_the_order_of_the_images_is_drawn() -> None:
    """So training is to the bit what it was before there was dropout."""
    _, start, views = scene()
    used, expected = np.random.default_rng(3), np.random.default_rng(3)
    train(start, views, 13, SETTINGS, used)
    for _ in range(3):
        expected.permutation(np.arange(len(views)))
    assert used.bit_generator.state == expected.bit_generator.state


def test_the_regularised_training_is_the_same_for_any_number_of_threads(with_threads) -> None:
    _, start, views = scene()
    settings = TrainingSettings(sh_degree=1, max_scale_m=0.3)
    assert settings.dropout_share > 0.0

    def trained(seed: int = 7) -> SplatAsset:
        return train(start, views, 30, settings, np.random.default_rng(seed))

    with_one = with_threads(1, trained)
    assert same_bits(with_one, trained())
    assert not same_bits(with_one, trained(8))


def test_depth_that_no_loss_asks_for_changes_nothing_and_is_not_prepared() -> None:
    _, start, views = scene()
    deep = [dataclasses.replace(v, depth=np.full(v.camera.shape, 2.0, np.float32)) for v in views]
    without, with_depth = (train(start, seen, 20, SETTINGS, np.random.default_rng(0)) for seen in (views, deep))
    assert same_bits(without, with_depth)
    small, large = (Targets(deep, 1 << 20, with_geometry=g).get(0, Lattice(2)) for g in (False, True))
    assert small.depth is None and small.depth_weight is None and large.depth.shape == small.camera.shape
    asked = dataclasses.replace(SETTINGS, depth_weight=0.1)
    assert not same_bits(without, train(start, deep, 20, asked, np.random.default_rng(0)))


def test_gaussians_move_where_all_images_are_of_one_place() -> None:
    true, start, _ = scene()
    place = np.array([0.1, -0.7, -1.3])  # whose mean over three is not quite itself
    lenses = [c.at(look_at(place, [x, 0.0, 2.0])) for c, x in zip(cameras(3), (-0.3, 0.0, 0.3), strict=True)]
    views = [Observation(c, np.clip(render(true, c).colour, 0, 1)) for c in lenses]
    trained = train(start, views, 20, SETTINGS, np.random.default_rng(0))
    assert np.linalg.norm(trained.means - start.means, axis=1).max() > 1e-4

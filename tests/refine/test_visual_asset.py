"""The asset of the loop: growth where it misses geometry, trust where it agrees."""

import dataclasses

import numpy as np
import pytest

from r2sego_blender.config.presets import UNREGULARISED
from r2sego_blender.config.settings import Settings, TrainingSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.progress import SILENT
from r2sego_blender.generation.ego_views import VIEWS
from r2sego_blender.geometry.proxy.proxy import PROXY
from r2sego_blender.refine.capture_steps import AlignedPriors, RegisteredCaptures
from r2sego_blender.refine.steps import Steps
from r2sego_blender.refine.visual_asset import (
    PseudoView,
    agreement,
    disc_stride_px,
    grow,
    settings_of_round,
    update_visual_asset,
)
from r2sego_blender.splats.artifacts import INITIAL_ASSET
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.metrics import psnr
from r2sego_blender.splats.rendering.rasterizer import render
from r2sego_blender.splats.training.backdrop import backdrop
from r2sego_blender.splats.training.initialization import DepthView

SETTINGS = TrainingSettings(steps_per_round=60, max_gaussians=5000, sh_degree=1)
WALL_Y_M = 2.0


def wall_view(x_m: float, shade: float = 0.0) -> DepthView:
    """A camera at (x, 0, 1) that faces a striped wall, with its exact depth and image."""
    camera = Camera(96, 72, 80, 80, 48, 36, look_at((x_m, 0.0, 1.0), (x_m, WALL_Y_M, 1.0)))
    depth = np.full(camera.shape, WALL_Y_M, np.float32)
    points = camera.unproject(depth)
    stripes = 0.5 + 0.3 * np.sin(3.0 * points[..., :1]) * np.cos(2.0 * points[..., 2:])
    image = np.clip(np.repeat(stripes, 3, axis=2) * [1.0, 0.8, 0.6] + shade, 0.0, 1.0)
    return DepthView(camera, depth, image.astype(np.float32), stride_px=2)


def pseudo(view: DepthView) -> PseudoView:
    return PseudoView(view, np.ones(view.camera.shape, np.float32))


def coverage(asset: SplatAsset, view: DepthView) -> float:
    inside = render(asset, view.camera).alpha[6:-6, 6:-6]
    return float((inside > 0.8).mean())


def test_growing_covers_what_was_missing_and_adds_nothing_twice():
    rng = np.random.default_rng(0)
    grown = grow(SplatAsset.empty(), [wall_view(0.0)], SETTINGS, rng)
    assert coverage(grown, wall_view(0.0)) > 0.95
    assert coverage(grown, wall_view(1.2)) < 0.8
    wider = grow(grown, [wall_view(1.2)], SETTINGS, rng)
    assert coverage(wider, wall_view(1.2)) > 0.95
    again = grow(wider, [wall_view(0.0), wall_view(1.2)], SETTINGS, rng)
    assert len(again) - len(wider) < 0.2 * len(wider)


def test_growing_leaves_pixels_without_geometry_alone():
    view = wall_view(0.0)
    unknown = dataclasses.replace(view, depth=np.zeros_like(view.depth))
    assert len(grow(SplatAsset.empty(), [unknown], SETTINGS, np.random.default_rng(0))) == 0


def test_the_budget_of_gaussians_is_hard():
    few = dataclasses.replace(SETTINGS, max_gaussians=300)
    asset = grow(SplatAsset.empty(), [wall_view(0.0), wall_view(1.2)], few, np.random.default_rng(0))
    assert len(asset) == 300


def test_an_asset_beyond_the_budget_is_thinned_and_still_covers_what_it_did():
    whole = grow(SplatAsset.empty(), [wall_view(0.0)], SETTINGS, np.random.default_rng(0))
    few = dataclasses.replace(SETTINGS, max_gaussians=len(whole) // 2)
    thin = grow(whole, [], few, np.random.default_rng(0))
    assert len(thin) == len(whole) // 2
    assert coverage(thin, wall_view(0.0)) > 0.75
    areas = [np.exp(one.log_scales[:, :2].sum(axis=1)).sum() for one in (thin, whole)]
    assert areas[0] == pytest.approx(areas[1], rel=0.1)
    assert len(grow(whole, [], SETTINGS, np.random.default_rng(0))) == len(whole)


def test_a_generated_frame_is_trusted_where_it_agrees_with_the_asset():
    asset = grow(SplatAsset.empty(), [wall_view(0.0)], SETTINGS, np.random.default_rng(0))
    agreeing = agreement(asset, pseudo(wall_view(0.0)))[8:-8, 8:-8]
    contradicting = agreement(asset, pseudo(wall_view(0.0, shade=0.4)))[8:-8, 8:-8]
    assert agreeing.mean() > 0.9 and contradicting.mean() < 0.1


def test_a_generated_frame_keeps_its_own_confidence_where_the_asset_is_empty():
    view = dataclasses.replace(pseudo(wall_view(0.0)), confidence=np.full((72, 96), 0.3, np.float32))
    np.testing.assert_allclose(agreement(SplatAsset.empty(), view), 0.3)


def test_the_agreement_falls_to_1_over_e_at_a_difference_of_0_12_and_scales_the_confidence():
    asset = grow(SplatAsset.empty(), [wall_view(0.0)], SETTINGS, np.random.default_rng(0))
    view = wall_view(0.6)  # its right side is beyond the asset
    now = render(asset, view.camera)
    for apart in (0.0, 0.12, 0.24):
        frame = dataclasses.replace(view, image=now.colour - np.float32(apart))
        trusted = agreement(asset, PseudoView(frame, np.full(view.camera.shape, 0.5, np.float32)))
        shown = now.alpha >= 0.8
        assert 0.3 < shown.mean() < 0.9
        np.testing.assert_allclose(trusted[shown], 0.5 * np.exp(-((apart / 0.12) ** 2)), rtol=1e-4)
        np.testing.assert_array_equal(trusted[~shown], np.float32(0.5))


def test_an_update_covers_what_only_a_generated_view_shows():
    views, aside = [wall_view(-0.3), wall_view(0.3)], wall_view(4.0)
    asset = update_visual_asset(
        SplatAsset.empty(), SplatAsset.empty(), views, [pseudo(aside)], SETTINGS, np.random.default_rng(0)
    )
    assert coverage(asset, aside) > 0.95


def test_a_generated_view_is_drawn_as_often_as_it_weighs(monkeypatch):
    """Over all draws a pixel counts w_syn times its agreement, whatever the rest of its view is worth."""
    asset = grow(SplatAsset.empty(), [wall_view(0.0)], SETTINGS, np.random.default_rng(0))
    shown = [pseudo(wall_view(0.1, shade)) for shade in (0.0, 0.1, 0.5)]
    trained = []

    def train(asset, observations, *others):
        trained.append((asset, observations))
        return asset

    monkeypatch.setattr("r2sego_blender.refine.visual_asset.train", train)
    settings = dataclasses.replace(SETTINGS, synthetic_weight=0.7)
    update_visual_asset(asset, SplatAsset.empty(), [wall_view(0.0)], shown, settings, np.random.default_rng(0))
    _, (grown, (capture, *views)) = trained
    assert capture.draws == SETTINGS.capture_oversampling
    for one, view in zip(shown, views, strict=True):
        np.testing.assert_allclose(view.draws * view.weight * view.confidence, 0.7 * agreement(grown, one), rtol=1e-5)
    draws = [view.draws for view in views]
    assert draws == sorted(draws, reverse=True)
    assert draws[0] > 5.0 * draws[2]


@pytest.mark.parametrize(
    ("real_weight", "synthetic_weight", "draws", "captures_first", "shade", "learnt"),
    [
        (1.0, 0.5, 3, 0.0, 0.05, "capture"),
        (1.0, 2.0, 3, 0.0, 0.05, "capture"),
        (1.0, 2.0, 1, 0.0, 0.05, "generated"),
        (1.0, 8.0, 3, 0.0, 0.05, "generated"),
        (0.1, 0.5, 3, 0.0, 0.05, "generated"),
        (1.0, 0.0, 1, 0.0, 0.05, "capture"),  # of no weight, a generated view is never drawn
        (1.0, 8.0, 3, 1.0, 0.05, "capture"),  # all steps see the captures alone
        (1.0, 8.0, 3, 0.0, 0.2, "capture"),  # so far from the asset, the generated view hardly counts
    ],
)
def test_of_two_colours_the_one_with_the_larger_sum_of_weights_is_learnt(
    real_weight, synthetic_weight, draws, captures_first, shade, learnt
):
    """By the absolute error: the weighted median. A capture's sum is its weight times its draws."""
    settings = dataclasses.replace(
        SETTINGS,
        steps_per_round=120,
        sh_degree=0,
        ssim_weight=0.0,
        opaque_weight=0.0,
        dropout_share=0.0,
        real_weight=real_weight,
        synthetic_weight=synthetic_weight,
        capture_oversampling=draws,
        captures_first_share=captures_first,
    )
    capture, generated = wall_view(0.0), wall_view(0.0, shade=shade)
    between = grow(SplatAsset.empty(), [wall_view(0.0, shade=0.025)], SETTINGS, np.random.default_rng(0))
    asset = update_visual_asset(
        between, SplatAsset.empty(), [capture], [pseudo(generated)], settings, np.random.default_rng(0)
    )
    shown = render(asset, capture.camera).colour[8:-8, 8:-8]
    apart = {
        name: np.abs(shown - view.image[8:-8, 8:-8]).mean()
        for name, view in (("capture", capture), ("generated", generated))
    }
    assert min(apart, key=apart.get) == learnt
    assert min(apart.values()) < 0.5 * max(apart.values())


@pytest.mark.parametrize("with_pseudo", [False, True])
def test_an_update_learns_the_captures(with_pseudo):
    views = [wall_view(-0.3), wall_view(0.3)]
    synthetic = [pseudo(wall_view(0.6))] if with_pseudo else []
    asset = update_visual_asset(
        SplatAsset.empty(), SplatAsset.empty(), views, synthetic, SETTINGS, np.random.default_rng(0)
    )
    started = grow(SplatAsset.empty(), views, SETTINGS, np.random.default_rng(0))

    def quality(trained: SplatAsset) -> float:
        return float(np.mean([psnr(np.clip(render(trained, v.camera).colour, 0, 1), v.image) for v in views]))

    assert quality(asset) > quality(started) + 2.0


def test_what_differs_from_photograph_to_photograph_is_learnt_less_with_the_regularisers():
    rng = np.random.default_rng(5)
    exact, between = [wall_view(-0.3), wall_view(0.3)], wall_view(0.0)
    views = [
        dataclasses.replace(
            v, image=np.clip(v.image + rng.normal(0.0, 0.1, v.image.shape), 0.0, 1.0).astype(np.float32)
        )
        for v in exact
    ]

    def quality(settings: TrainingSettings) -> float:
        asset = update_visual_asset(
            SplatAsset.empty(), SplatAsset.empty(), views, [], settings, np.random.default_rng(0)
        )
        return psnr(np.clip(render(asset, between.camera).colour, 0, 1), between.image)

    settings = dataclasses.replace(SETTINGS, steps_per_round=200)
    assert (settings.max_scale_m, settings.dropout_share) == (0.15, 0.2)
    assert quality(settings) > quality(dataclasses.replace(settings, **UNREGULARISED)) + 0.5


def test_the_first_round_is_as_set_and_later_ones_are_slower_and_see_every_pixel():
    lower = {"every_third_pixel_share": 0.4, "every_second_pixel_share": 0.3}
    settings = dataclasses.replace(SETTINGS, later_rounds_learning_rate_ratio=0.25, **lower)
    assert settings_of_round(settings, 0) == settings
    later, third = settings_of_round(settings, 1), settings_of_round(settings, 2)
    assert settings_of_round(settings, 5) == third
    rates = {f"{name}_learning_rate" for name in ("position", "scale", "rotation", "opacity", "colour")}
    for field in dataclasses.fields(settings):
        before, after = getattr(settings, field.name), getattr(later, field.name)
        if field.name in rates:
            assert after == 0.25 * before > 0.0
            assert getattr(third, field.name) == 0.25 * after
        elif field.name in lower:
            assert after == 0.0 < before
        else:
            assert after == before
        assert field.name in rates or getattr(third, field.name) == after


@pytest.mark.parametrize("index", [0, 1, 2])
def test_the_step_of_a_round_trains_and_is_known_by_the_settings_of_that_round(index):
    asked = {}

    class Asked:
        def make(self, made, compute, *takes, settings=None, **_):
            asked[made.name] = settings

    h = Settings()
    Steps(Asked(), h, SILENT).update_visual_asset(
        index, INITIAL_ASSET, RegisteredCaptures(), AlignedPriors(), PROXY, [VIEWS]
    )
    assert asked[f"rounds/{index}/asset.ply"] == [settings_of_round(h.training, index), h.seed]


def test_a_later_round_keeps_what_is_learnt():
    """It moves the colours far less than another round at the first one's rates."""
    views = [wall_view(-0.3), wall_view(0.3)]
    settings = dataclasses.replace(SETTINGS, steps_per_round=150)

    def updated(asset: SplatAsset, index: int) -> SplatAsset:
        return update_visual_asset(
            asset, SplatAsset.empty(), views, [], settings_of_round(settings, index), np.random.default_rng(1)
        )

    first = updated(SplatAsset.empty(), 0)
    again, later = (updated(first, index) for index in (0, 1))

    def moved(asset: SplatAsset) -> float:
        return float(np.abs(asset.sh[: len(first), 0] - first.sh[:, 0]).mean())

    assert 0.0 < moved(later) < 0.5 * moved(again)


def test_an_update_uses_its_depth_only_where_that_has_a_weight():
    views = [wall_view(-0.3), wall_view(0.3)]
    told = [dataclasses.replace(v, depth=0.9 * v.depth) for v in views]

    def trained(views: list[DepthView], depth_weight: float) -> bytes:
        start = grow(SplatAsset.empty(), [wall_view(0.0)], SETTINGS, np.random.default_rng(0))
        settings = dataclasses.replace(SETTINGS, depth_weight=depth_weight)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("r2sego_blender.refine.visual_asset.grow", lambda asset, *_: asset)
            asset = update_visual_asset(start, SplatAsset.empty(), views, [], settings, np.random.default_rng(0))
        return asset.means.tobytes()

    assert trained(views, 0.0) == trained(told, 0.0)
    assert trained(views, 1.0) != trained(told, 1.0)


@pytest.mark.parametrize("key", ["normal_weight", "exposure_learning_rate", "pose_learning_rate"])
def test_what_an_update_may_use_or_correct_it_does_where_its_setting_says_so(key):
    """The darker, moved view is a generated one: only its brightness and pose may be corrected."""
    capture, other = wall_view(-0.3), wall_view(0.3)
    aside = other.camera.world_from_camera.copy()
    aside[0, 3] += 0.03
    darker = (0.8 * other.image).astype(np.float32)
    generated = pseudo(dataclasses.replace(other, image=darker, camera=other.camera.at(aside)))
    start = grow(SplatAsset.empty(), [capture], SETTINGS, np.random.default_rng(0))

    def trained(pseudo_observations: list[PseudoView], value: float) -> bytes:
        settings = dataclasses.replace(SETTINGS, **{key: value})
        asset = update_visual_asset(
            start, SplatAsset.empty(), [capture], pseudo_observations, settings, np.random.default_rng(0)
        )
        return asset.means.tobytes() + asset.sh.tobytes()

    assert trained([generated], 0.0) != trained([generated], 0.01)
    if key != "normal_weight":
        assert trained([], 0.0) == trained([], 0.01)


@pytest.mark.parametrize(
    ("captures", "detailed_share", "stride_px"),
    [(1, 1.0, 3), (6, 1.0, 3), (13, 1.0, 4), (60, 1.0, 9), (13, 0.0, 3), (60, 0.0, 4)],
)
def test_more_captures_share_the_budget_by_coarser_discs(captures, detailed_share, stride_px):
    camera = Camera(640, 480, 500, 500, 320, 240, np.eye(4))
    settings = TrainingSettings(max_gaussians=120000, disc_stride_px=3, detailed_share=detailed_share)
    assert disc_stride_px([camera] * captures, settings) == stride_px


def test_the_backdrop_is_left_as_it_is_and_not_painted_over():
    """Pixels without depth, which show the backdrop, get no Gaussians from the update."""
    views = [wall_view(-0.3), wall_view(0.3)]
    behind = backdrop(views, 800)
    before = behind.means.tobytes(), behind.sh.tobytes()
    half = [
        dataclasses.replace(
            v,
            depth=np.where(np.arange(96) < 48, v.depth, 0.0).astype(np.float32),
            image=np.where((np.arange(96) < 48)[:, None], v.image, render(behind, v.camera).colour).astype(np.float32),
        )
        for v in views
    ]
    asset = update_visual_asset(SplatAsset.empty(), behind, half, [], SETTINGS, np.random.default_rng(0))
    assert (behind.means.tobytes(), behind.sh.tobytes()) == before
    assert render(asset, views[0].camera).alpha[:, 82:].mean() < 0.1
    assert coverage(asset, views[0]) > 0.4

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from splat_reference import random_asset, small_camera

from r2sego_blender.config.presets import EVERY_PIXEL, UNREGULARISED, VANILLA_3DGS
from r2sego_blender.config.settings import TrainingSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.kernels.packing import PackedGaussians
from r2sego_blender.splats.metrics import psnr
from r2sego_blender.splats.rendering.rasterizer import render
from r2sego_blender.splats.training.densification import Densification
from r2sego_blender.splats.training.initialization import from_points
from r2sego_blender.splats.training.observations import Observation
from r2sego_blender.splats.training.population import Population
from r2sego_blender.splats.training.training import train

BASE = dataclasses.replace(
    TrainingSettings(**EVERY_PIXEL, **UNREGULARISED),
    sh_degree=0,
    max_gaussians=1000,
    densify_every_steps=20,
    densify_from_share=0.05,
)


def with_settings(**changes) -> TrainingSettings:
    return dataclasses.replace(BASE, **changes)


def started(settings: TrainingSettings, count: int = 200) -> tuple[Population, Densification]:
    asset = random_asset(np.random.default_rng(0), count, degree=0)
    population = Population.of(PackedGaussians.of(asset, settings.max_gaussians))
    shifts = np.random.default_rng(1).uniform(0.0, 1e-3, population.state.statistics[:, 0].shape)
    population.state.statistics[:, 0], population.state.statistics[:, 1] = shifts, 1.0
    return population, Densification(population, 100, 1.0, settings, np.random.default_rng(2))


@pytest.mark.parametrize("way", ["growth", "relocation", "original"])
def test_the_budget_is_never_passed(way: str) -> None:
    settings = with_settings(densification=way, max_gaussians=230, densify_until_share=1.0)
    population, densification = started(settings)
    for step in range(100):
        population.state.statistics[:] = 1.0
        densification.after(step)
        assert len(population) <= 230
    assert len(population) > 200


def test_growth_ends_at_the_budget() -> None:
    population, densification = started(with_settings(densification="growth", densify_until_share=1.0))
    sizes = []
    for step in range(100):
        population.state.statistics[:] = 1.0
        densification.after(step)
        sizes.append(len(population))
    assert sizes == sorted(sizes)
    assert 0.95 * 1000 <= sizes[-1] <= 1000


def test_growth_adds_where_the_images_pull() -> None:
    settings = with_settings(densification="growth", split_scale=1.0)
    population, densification = started(settings)
    population.state.statistics[:, 0] = 0.0
    pulled = np.array([5, 40, 77])
    population.state.statistics[pulled // 16, 0, pulled % 16] = 1e-3
    means = population.columns(0, 3)
    alive = 1.0 / (1.0 + np.exp(-population.column(10))) >= settings.dead_opacity
    densification.after(19)
    assert len(population) == alive.sum() + 3
    found = population.columns(0, 3)
    for mean in means[pulled]:
        assert (np.abs(found - mean).max(axis=1) < 1e-6).sum() == 2


def test_nothing_is_added_before_and_after_the_time_for_it() -> None:
    settings = with_settings(densification="growth", densify_from_share=0.3, densify_until_share=0.5)
    population, densification = started(settings)
    changed = []
    for step in range(100):
        population.state.statistics[:] = 1.0
        before = len(population)
        densification.after(step)
        if len(population) != before:
            changed.append(step + 1)
    assert changed == [40]


def test_a_relocated_gaussian_and_its_copies_look_as_it_did() -> None:
    wall = SplatAsset(
        means=[[0.0, 0.0, 2.0], [50.0, 0.0, -2.0]],
        log_scales=np.log(np.full((2, 3), 0.3)),
        quaternions=[[1.0, 0, 0, 0]] * 2,
        logit_opacities=[1.5, -20.0],
        sh=np.full((2, 1, 3), 0.8),
    )
    camera = Camera(64, 64, 64.0, 64.0, 32.0, 32.0, np.eye(4))
    before = render(wall, camera)
    settings = with_settings(densification="relocation", max_gaussians=2)
    population = Population.of(PackedGaussians.of(wall, 2))
    Densification(population, 100, 1.0, settings, np.random.default_rng(0)).after(19)
    moved = population.gaussians.asset()
    np.testing.assert_allclose(moved.means, [[0.0, 0.0, 2.0]] * 2)
    assert moved.log_scales.max() < wall.log_scales[0].max()
    after = render(moved, camera)
    # The middle keeps its opacity exactly, the whole its mass to a few percent.
    assert after.alpha[32, 32] == pytest.approx(before.alpha[32, 32], abs=2e-3)
    assert after.alpha.sum() == pytest.approx(before.alpha.sum(), rel=0.05)


def test_the_original_copies_small_and_splits_large_gaussians() -> None:
    settings = with_settings(densification="original", split_scale=0.1, gradient_threshold=1e-4)
    asset = random_asset(np.random.default_rng(0), 2, degree=0)
    asset.log_scales[0], asset.log_scales[1] = np.log(0.05), np.log(0.5)
    asset.logit_opacities[:] = 1.0
    population = Population.of(PackedGaussians.of(asset, 10))
    population.state.statistics[:] = 1.0
    Densification(population, 100, 1.0, settings, np.random.default_rng(0)).after(19)
    after = population.gaussians.asset()
    assert len(after) == 4
    small = np.isclose(after.log_scales[:, 0], np.log(0.05), atol=1e-5)
    large = np.isclose(after.log_scales[:, 0], np.log(0.5 / 1.6), atol=1e-5)
    assert small.sum() == 2
    assert large.sum() == 2
    np.testing.assert_array_equal(after.means[small][0], after.means[small][1])
    assert np.abs(after.means[large] - asset.means[1]).max() > 1e-3


def test_the_original_resets_opacities() -> None:
    settings = with_settings(densification="original", opacity_reset_steps=30, gradient_threshold=1.0)
    population, densification = started(settings)
    densification.after(29)
    opacity = population.gaussians.asset().opacities
    assert opacity.max() <= 0.0101


@pytest.mark.parametrize(("way", "gain_db"), [("growth", 0.5), ("relocation", 0.2), ("original", 0.5)])
def test_adding_gaussians_reproduces_the_images_better(way: str, gain_db: float) -> None:
    true = random_asset(np.random.default_rng(3), 400, degree=0)
    true.log_scales[:] -= 1.0
    poses = [look_at([x, -0.2, -1.5], [0.0, 0.0, 2.0]) for x in np.linspace(-0.8, 0.8, 4)]
    cameras = [Camera(96, 72, 96.0, 96.0, 48.0, 36.0, pose) for pose in poses]
    views = [Observation(c, np.clip(render(true, c).colour, 0, 1)) for c in cameras]
    chosen = np.random.default_rng(4).choice(400, 40, replace=False)
    start = from_points(true.means[chosen], true.base_colours[chosen], BASE, np.random.default_rng(0))

    def quality(densification: str) -> tuple[float, int]:
        settings = with_settings(
            densification=densification,
            max_gaussians=600,
            opacity_reset_steps=10**6,
            densify_every_steps=5 if densification == "relocation" else 20,
            densify_until_share=0.6,
        )
        asset = train(start, views, 400, settings, np.random.default_rng(0))
        scores = [psnr(np.clip(render(asset, v.camera).colour, 0, 1), v.image) for v in views]
        return float(np.mean(scores)), len(asset)

    fixed, count = quality("none")
    grown, more = quality(way)
    assert count == 40
    assert 40 < more <= 600
    assert grown > fixed + gain_db


def test_the_same_seed_gives_the_same_asset() -> None:
    camera = small_camera(64, 48)
    views = [Observation(camera, np.full((48, 64, 3), 0.4, np.float32))]
    start = random_asset(np.random.default_rng(0), 60, degree=0)
    settings = with_settings(densification="relocation", max_gaussians=120)
    first, second = (train(start, views, 60, settings, np.random.default_rng(5)) for _ in range(2))
    assert len(first) == len(second) > 60
    np.testing.assert_array_equal(first.means, second.means)


def test_vanilla_3dgs_is_a_configuration_of_the_same_trainer() -> None:
    settings = dataclasses.replace(TrainingSettings(), **VANILLA_3DGS)
    assert settings.densification == "original"
    rates = {"position": 1.6e-4, "scale": 0.005, "rotation": 0.001, "opacity": 0.05, "colour": 0.0025}
    assert {name: getattr(settings, f"{name}_learning_rate") for name in rates} == rates
    assert settings.ssim_weight == 0.2
    assert settings.harmonics_learning_rate_ratio == 1 / 20
    assert (settings.gradient_threshold, settings.split_scale, settings.dead_opacity) == (2e-4, 0.01, 0.005)
    assert (settings.densify_every_steps, settings.opacity_reset_steps) == (100, 3000)
    assert round(settings.densify_from_share * 30000) == 500
    assert round(settings.densify_until_share * 30000) == 15000

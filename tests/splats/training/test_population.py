from __future__ import annotations

import numpy as np
import pytest
from splat_reference import random_asset, small_camera

from r2sego_blender.splats.kernels.packing import LOGIT_OPACITY, MEAN, PackedGaussians
from r2sego_blender.splats.rendering.rasterizer import Rasterizer, render
from r2sego_blender.splats.training.population import Population

GROUPS = ("means", "log_scales", "quaternions", "logit_opacities", "sh")


def population(count: int, capacity: int) -> Population:
    asset = random_asset(np.random.default_rng(0), count, degree=1)
    return Population.of(PackedGaussians.of(asset, capacity))


@pytest.mark.parametrize(("count", "added"), [(1, 1), (15, 3), (16, 16), (33, 60)])
def test_appended_gaussians_come_after_the_others_in_the_asset(count: int, added: int) -> None:
    many = population(count, count + added)
    before = many.gaussians.asset()
    rows = many.rows(np.arange(added) % count).copy()
    rows[:, MEAN] += 1.0
    places = many.append(rows)
    after = many.gaussians.asset()
    assert len(after) == count + added
    for name in GROUPS:
        np.testing.assert_array_equal(getattr(after, name)[:count], getattr(before, name))
    np.testing.assert_array_equal(after.means[count:], rows[:, MEAN : MEAN + 3])
    np.testing.assert_array_equal(many.rows(places), rows)


def test_there_is_room_for_the_capacity() -> None:
    many = population(20, 50)
    assert many.room >= 30
    many.append(many.rows(np.arange(20)))
    assert many.room >= 10


def test_arranging_keeps_rows_and_memory_together() -> None:
    many = population(50, 64)
    rng = np.random.default_rng(1)
    for chunks in (many.state.first, many.state.second, many.state.statistics):
        chunks[:] = rng.normal(size=chunks.shape)
    many.state.steps[:] = rng.integers(1, 9, many.state.steps.shape)
    places = rng.permutation(50)[:30]
    asset = many.gaussians.asset()
    numbers, rows = many.gaussians.order[places], many.rows(places).copy()
    moments = many.state.first[places // 16, :, places % 16].copy()
    steps = many.state.steps[places // 16, places % 16].copy()
    many.arrange(places)
    here = np.arange(30)
    np.testing.assert_array_equal(many.rows(here), rows)
    np.testing.assert_array_equal(many.state.first[here // 16, :, here % 16], moments)
    np.testing.assert_array_equal(many.state.steps[here // 16, here % 16], steps)
    # The asset's order is kept among those that stay.
    np.testing.assert_array_equal(many.gaussians.asset().means, asset.means[np.sort(numbers)])


def test_places_that_are_free_again_are_not_drawn() -> None:
    many, camera = population(40, 48), small_camera()
    many.arrange(np.arange(7))
    rasterizer = Rasterizer()
    rasterizer.forward(many.gaussians, camera)
    np.testing.assert_array_equal(rasterizer.colour, render(many.gaussians.asset(), camera).colour)


def test_replaced_gaussians_start_anew() -> None:
    many = population(20, 20)
    many.state.first[:], many.state.steps[:], many.state.statistics[:] = 1.0, 5.0, 2.0
    places = np.array([3, 17])
    many.replace(places, many.rows(np.array([0, 1])))
    assert not many.state.first[places // 16, :, places % 16].any()
    assert not many.state.steps[places // 16, places % 16].any()
    assert many.state.first[0, :, 0].all()


def test_statistics_are_means_since_the_last_call() -> None:
    many = population(20, 20)
    many.state.statistics[:, 0], many.state.statistics[:, 1] = 6.0, 3.0
    np.testing.assert_allclose(many.statistics(), 2.0)
    assert not many.statistics().any()


def test_sorting_changes_no_image() -> None:
    many, camera = population(60, 60), small_camera()
    many.arrange(np.random.default_rng(0).permutation(60))
    image = render(many.gaussians.asset(), camera).colour
    many.sort()
    np.testing.assert_array_equal(render(many.gaussians.asset(), camera).colour, image)


def test_a_changed_parameter_is_the_asset_s() -> None:
    many = population(30, 30)
    many.set_column(np.arange(30), LOGIT_OPACITY, np.full(30, -2.0))
    np.testing.assert_array_equal(many.gaussians.asset().logit_opacities, -2.0)

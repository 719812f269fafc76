"""Gaussians left out of a step: how many, what is seen meanwhile, and that they stay as they are."""

from __future__ import annotations

import dataclasses
from contextlib import AbstractContextManager

import numpy as np
import pytest
from splat_reference import random_asset, small_camera

from r2sego_blender.splats.backends.cpu import CpuBackend
from r2sego_blender.splats.kernels.adam import AdamState
from r2sego_blender.splats.kernels.packing import LOGIT_OPACITY, PackedGaussians, unpack
from r2sego_blender.splats.rendering.rasterizer import Rasterizer, render
from r2sego_blender.splats.training.dropout import Dropout


def leaving_out(gaussians: PackedGaussians, dropout: Dropout) -> AbstractContextManager[None]:
    return CpuBackend(gaussians, AdamState.of(gaussians)).leaving_out(dropout.drawn(len(gaussians)))


def columns(gaussians: PackedGaussians) -> np.ndarray:
    """All parameters (N, C), a copy."""
    return unpack(gaussians.chunks, len(gaussians)).copy()


def left_out_of(gaussians: PackedGaussians) -> np.ndarray:
    return columns(gaussians)[:, LOGIT_OPACITY] < -1e20


@pytest.mark.parametrize("share", [0.05, 0.2, 0.7])
def test_the_share_is_left_out_and_drawn_anew(share: float) -> None:
    packed = PackedGaussians.of(random_asset(np.random.default_rng(0), 20_003, degree=0))
    before, dropout, drawn = packed.chunks.tobytes(), Dropout(share, np.random.default_rng(1)), []
    for _ in range(2):
        with leaving_out(packed, dropout):
            drawn.append(left_out_of(packed))
        assert packed.chunks.tobytes() == before
    sigma = np.sqrt(share * (1.0 - share) / len(packed))
    for left_out in drawn:
        assert abs(left_out.mean() - share) < 4.0 * sigma
    # two draws have nothing to do with each other
    assert abs((drawn[0] & drawn[1]).mean() - share**2) < 4.0 * sigma


def test_a_share_of_0_draws_nothing() -> None:
    packed, rng = PackedGaussians.of(random_asset(np.random.default_rng(0), 50)), np.random.default_rng(1)
    before, state = packed.chunks.tobytes(), rng.bit_generator.state
    with leaving_out(packed, Dropout(0.0, rng)):
        assert packed.chunks.tobytes() == before
    assert rng.bit_generator.state == state


def test_what_is_seen_meanwhile_is_the_gaussians_that_stay() -> None:
    asset, camera, rasterizer = random_asset(np.random.default_rng(0), 203), small_camera(), Rasterizer()
    packed = PackedGaussians.of(asset)
    with leaving_out(packed, Dropout(0.4, np.random.default_rng(2))):
        rasterizer.forward(packed, camera)
        stays = np.ones(len(asset), bool)
        stays[packed.order[left_out_of(packed)]] = False
    expected = render(asset.subset(stays), camera)
    np.testing.assert_allclose(rasterizer.colour, expected.colour, atol=1e-6)
    np.testing.assert_allclose(1.0 - rasterizer.transmittance, expected.alpha, atol=1e-6)
    assert np.abs(render(asset, camera).colour - expected.colour).max() > 0.05


def test_those_left_out_keep_their_parameters_and_moments_in_that_step() -> None:
    packed, rasterizer = PackedGaussians.of(random_asset(np.random.default_rng(0), 203)), Rasterizer()
    state, camera, dropout = AdamState.of(packed), small_camera(), Dropout(0.4, np.random.default_rng(2))
    rates = np.full(packed.chunks.shape[1], 1e-3, np.float32)

    def remembered() -> np.ndarray:
        chunks = (packed.chunks, state.first, state.second, state.statistics, state.steps[:, None])
        return np.concatenate([unpack(c, len(packed)) for c in chunks], axis=1)

    moved_ever = np.zeros(len(packed), bool)
    for _ in range(12):
        before = remembered()
        with leaving_out(packed, dropout):
            left_out = left_out_of(packed)
            rasterizer.forward(packed, camera)
            rasterizer.gradient_planes[:3] = 0.0
            rasterizer.gradient_planes[:3, : camera.height, : camera.width] = 1.0
            rasterizer.step(state, rates, opacity_pull=0.1, scale_pull=0.1)
        after = remembered()
        np.testing.assert_array_equal(after[left_out], before[left_out])
        moved = (after != before).any(axis=1)
        assert moved[~left_out].sum() > 20
        moved_ever |= moved
    # in the long run all that the camera sees is trained
    rasterizer.forward(packed, camera)
    seen = rasterizer.backward(np.ones((*camera.shape, 3), np.float32)).logit_opacities != 0.0
    assert moved_ever[np.argsort(packed.order)][seen].mean() > 0.95


def test_opacities_come_back_though_the_step_fails() -> None:
    asset = random_asset(np.random.default_rng(0), 50)
    packed = PackedGaussians.of(asset)
    with pytest.raises(KeyboardInterrupt), leaving_out(packed, Dropout(0.5, np.random.default_rng(0))):
        assert left_out_of(packed).any()
        raise KeyboardInterrupt
    same = packed.asset()
    for field in dataclasses.fields(asset):
        np.testing.assert_array_equal(getattr(same, field.name), getattr(asset, field.name))

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from splat_reference import parameters, random_asset, rasterize, scenes, small_camera, twisted

from r2sego_blender.core.cameras import Camera
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.kernels.adam import AdamState
from r2sego_blender.splats.kernels.packing import PackedGaussians
from r2sego_blender.splats.rendering.rasterizer import Gradients, Rasterizer, render

BACKGROUND = (0.2, 0.5, 0.3)
GROUPS = ("means", "log_scales", "quaternions", "logit_opacities", "sh")
Upstream = tuple[np.ndarray, np.ndarray, np.ndarray]


def upstream_of(camera: Camera, seed: int = 0) -> Upstream:
    """Gradients of a loss in colour, alpha and the depth sum."""
    rng = np.random.default_rng(seed)
    shapes = ((*camera.shape, 3), camera.shape, camera.shape)
    return tuple(rng.normal(size=shape).astype(np.float32) for shape in shapes)


def gradients_of(asset: SplatAsset, camera: Camera, upstream: Upstream) -> Gradients:
    rasterizer = Rasterizer()
    rasterizer.forward(PackedGaussians.of(asset), camera, BACKGROUND)
    return rasterizer.backward(*upstream)


def expected_gradients(asset: SplatAsset, camera: Camera, upstream: Upstream) -> dict[str, np.ndarray]:
    """Of the five groups and of the pose, float64, by torch."""
    leaves, twist = parameters(asset), torch.zeros(6, dtype=torch.float64, requires_grad=True)
    results = rasterize(*leaves, camera, BACKGROUND, twisted(camera, twist))
    loss = sum((result * torch.from_numpy(g)).sum() for result, g in zip(results, upstream, strict=True))
    (loss + 0.0 * sum(leaf.sum() for leaf in (*leaves, twist))).backward()  # none is left out
    return {name: leaf.grad.numpy() for name, leaf in zip((*GROUPS, "pose"), (*leaves, twist), strict=True)}


def assert_near(found: Gradients, expected: dict[str, np.ndarray], share: float, floor: float) -> None:
    for name, values in expected.items():
        error = np.linalg.norm(getattr(found, name) - values)
        assert error <= share * np.linalg.norm(values) + floor, name


@settings(max_examples=60, deadline=None, derandomize=True)
@given(scenes(most=25, largest_px=40, kinds=("mixed", "flat", "tiny")))
def test_every_gradient_equals_the_reference(scene: tuple[SplatAsset, Camera]) -> None:
    upstream = upstream_of(scene[1])
    assert_near(gradients_of(*scene, upstream), expected_gradients(*scene, upstream), 1e-4, 1e-6)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(scenes(most=25, largest_px=40, kinds=("huge", "thin")))
def test_gradients_of_gaussians_larger_than_the_view(scene: tuple[SplatAsset, Camera]) -> None:
    """Large parts nearly cancel in the gradient of a scale: the error is one of the parts'."""
    upstream = upstream_of(scene[1])
    expected = expected_gradients(*scene, upstream)
    whole = max(np.linalg.norm(values) for values in expected.values())
    assert_near(gradients_of(*scene, upstream), expected, 1e-4, 1e-3 * whole)


@pytest.mark.parametrize("degree", range(4))
def test_clamped_colours_and_opaque_gaussians(degree: int) -> None:
    rng = np.random.default_rng(degree)
    asset, camera = random_asset(rng, 40, degree), small_camera()
    asset.sh[::3, 0] = rng.normal(-2.0, 0.5, (14, 3))
    asset.logit_opacities[::4] = rng.uniform(math.log(99.0), 15.0, 10)
    upstream = upstream_of(camera)
    expected = expected_gradients(asset, camera, upstream)
    found = gradients_of(asset, camera, upstream)
    assert_near(found, expected, 1e-4, 0.0)
    clamped = (expected["sh"][::3] == 0.0).all(axis=1)
    assert clamped.any()
    assert not found.sh[::3].transpose(0, 2, 1)[clamped].any()


def test_each_image_alone_gives_its_gradient() -> None:
    asset, camera = random_asset(np.random.default_rng(5)), small_camera()
    upstream = upstream_of(camera)
    for kept in range(3):
        one = tuple(g if k == kept else np.zeros_like(g) for k, g in enumerate(upstream))
        expected = expected_gradients(asset, camera, one)
        assert_near(gradients_of(asset, camera, one), expected, 1e-4, 1e-7)
        rasterizer = Rasterizer()
        rasterizer.forward(PackedGaussians.of(asset), camera, BACKGROUND, with_depth=kept == 2)
        found = rasterizer.backward(one[0], *(g if k == kept else None for k, g in enumerate(one) if k))
        assert_near(found, expected, 1e-4, 1e-7)


@pytest.mark.parametrize("dilation_px2", [0.1, 2.0])
def test_another_dilation(dilation_px2: float) -> None:
    asset, camera = random_asset(np.random.default_rng(6)), small_camera()
    asset.log_scales[::2] -= 3.0
    upstream, rasterizer = upstream_of(camera), Rasterizer()
    rasterizer.forward(PackedGaussians.of(asset), camera, BACKGROUND, dilation_px2=dilation_px2)
    found, leaves = rasterizer.backward(*upstream), parameters(asset)
    results = rasterize(*leaves, camera, BACKGROUND, dilation_px2=dilation_px2)
    np.testing.assert_allclose(rasterizer.colour, results[0].detach(), atol=1e-5)
    sum((result * torch.from_numpy(g)).sum() for result, g in zip(results, upstream, strict=True)).backward()
    expected = {name: leaf.grad.numpy() for name, leaf in zip(GROUPS, leaves, strict=True)}
    assert_near(found, expected, 1e-4, 0.0)


def test_depth_has_no_gradient_in_an_image_without_depth() -> None:
    rasterizer, camera = Rasterizer(), small_camera()
    rasterizer.forward(PackedGaussians.of(random_asset(np.random.default_rng(0))), camera, with_depth=False)
    with pytest.raises(ValueError, match="without depth"):
        rasterizer.backward(*upstream_of(camera))


def test_the_pose_gradient_is_the_slope_of_the_loss() -> None:
    """Of wide faint Gaussians, whose edges, cut at 1/255, lie outside the image."""
    rng, camera = np.random.default_rng(3), small_camera()
    asset = SplatAsset(
        means=np.column_stack([rng.uniform(-0.5, 0.5, (12, 2)), np.linspace(1.0, 3.0, 12)]),
        log_scales=rng.uniform(0.0, 0.4, (12, 3)),
        quaternions=rng.normal(size=(12, 4)),
        logit_opacities=rng.uniform(-2.0, 0.0, 12),
        sh=rng.normal(scale=0.2, size=(12, 16, 3)),
    )
    smooth = np.sin(np.arange(camera.width) / 6.0) + np.cos(np.arange(camera.height) / 5.0)[:, None]
    weight = np.repeat(smooth[..., None], 3, axis=2).astype(np.float32)
    nothing = np.zeros(camera.shape, np.float32)
    gradient = gradients_of(asset, camera, (weight, nothing, nothing)).pose

    def loss(twist: np.ndarray) -> float:
        moved = np.linalg.inv(twisted(camera, torch.from_numpy(twist)).numpy())
        return float((render(asset, camera.at(moved), BACKGROUND).colour * weight).sum(dtype=np.float64))

    step = 2e-3
    slopes = [(loss(step * unit) - loss(-step * unit)) / (2.0 * step) for unit in np.eye(6)]
    np.testing.assert_allclose(gradient, slopes, atol=0.01 * np.abs(slopes).max())


def test_no_gaussian_has_no_gradient() -> None:
    camera = small_camera()
    for degree in range(4):
        gradients = gradients_of(SplatAsset.empty(degree), camera, upstream_of(camera))
        assert gradients.sh.shape == (0, (degree + 1) ** 2, 3)
        assert not gradients.pose.any()


ANY = st.floats(width=32, allow_nan=False, allow_infinity=False)


@st.composite
def absurd_assets(draw: st.DrawFn) -> SplatAsset:
    """Sensible Gaussians before a camera at the origin, some numbers replaced by any finite ones."""
    rng = np.random.default_rng(draw(st.integers(0, 1000)))
    asset = random_asset(rng, 20)
    asset.means[::2] = np.round(asset.means[::2])  # some straight ahead, some at the camera
    pool = np.float32([0.0, *draw(st.lists(ANY, min_size=1, max_size=6))])
    for name in draw(st.sets(st.sampled_from(GROUPS), min_size=1)):
        values = getattr(asset, name)
        replaced = rng.random(values.shape) < rng.choice([0.05, 0.3])
        values[replaced] = rng.choice(pool, replaced.sum())
    asset.quaternions[:2] = 0.0
    asset.logit_opacities[2] = -1e30
    return asset


@settings(max_examples=100, deadline=None, derandomize=True)
@given(absurd_assets(), st.sampled_from([1e-6, 1.0, 1e3]))
def test_finite_numbers_give_finite_images_gradients_and_steps(asset: SplatAsset, size: float) -> None:
    camera = Camera(33, 21, 30.0, 25.0, 16.5, 10.5, np.eye(4))
    upstream = tuple(size * g for g in upstream_of(camera))
    packed, rasterizer = PackedGaussians.of(asset), Rasterizer()
    state = AdamState.of(packed)
    rasterizer.forward(packed, camera, BACKGROUND)
    image = rasterizer.rendering()
    assert all(np.isfinite(a).all() for a in (image.colour, image.alpha, image.depth))
    gradients = rasterizer.backward(*upstream)
    assert all(np.isfinite(getattr(gradients, name)).all() for name in (*GROUPS, "pose"))
    rates = np.full(packed.values.shape[1], 0.01, np.float32)
    rasterizer.step(state, rates, 1e-3, 1e-3, with_alpha=True, with_depth=True)
    moved = packed.asset()
    assert all(np.isfinite(getattr(moved, name)).all() for name in GROUPS)
    assert np.isfinite(rasterizer.pose_gradient()).all()


def test_the_same_bits_for_every_run_and_number_of_threads(with_threads) -> None:
    asset, camera = random_asset(np.random.default_rng(9), count=3000), small_camera(160, 120)
    upstream = upstream_of(camera)

    def results() -> list[np.ndarray]:
        packed, rasterizer = PackedGaussians.of(asset), Rasterizer()
        state = AdamState.of(packed)
        rates = np.full(packed.values.shape[1], 1e-3, np.float32)
        for _ in range(3):
            rasterizer.forward(packed, camera, BACKGROUND)
            gradients = rasterizer.backward(*upstream)
            rasterizer.step(state, rates, 1e-3, 1e-3, with_alpha=True, with_depth=True)
        arrays = [getattr(gradients, name) for name in (*GROUPS, "pose")]
        arrays += [getattr(packed.asset(), name) for name in GROUPS]
        return [*arrays, rasterizer.pose_gradient(), rasterizer.planes, state.first, state.second, state.steps]

    with_one = with_threads(1, results)
    for with_all in (results(), results()):
        assert all(a.tobytes() == b.tobytes() for a, b in zip(with_one, with_all, strict=True))

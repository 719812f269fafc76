from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from splat_reference import alphas, frozen, on_screen, random_asset, scenes, small_camera, weights

from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import AssetError
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.kernels.packing import PackedGaussians
from r2sego_blender.splats.quaternions import to_rotation
from r2sego_blender.splats.rendering.outputs import NONE, facing_normals, render_batch, render_outputs
from r2sego_blender.splats.rendering.rasterizer import Rasterizer, render

MAPS = ("colour", "alpha", "depth", "normals", "gaussian", "instance", "visibility")
CLOSE = 1e-4
"""Weights this near to each other may change places by rounding."""


def brute_force(asset: SplatAsset, camera: Camera) -> SimpleNamespace:
    """Each Gaussian's weight and alpha in each pixel (N, H, W), and the transmittance before it."""
    screen = on_screen(*frozen(asset), camera)
    number = screen.number.numpy()
    weight, alpha, before = (np.zeros((len(asset), *camera.shape)) for _ in range(3))
    ordered = weights(screen, camera)[0].numpy()
    weight[number], alpha[number] = ordered, alphas(screen, camera).numpy()
    before[number] = 1.0 - (np.cumsum(ordered, axis=0) - ordered)
    return SimpleNamespace(weight=weight, alpha=alpha, before=before)


def assert_greatest(found: np.ndarray, score: np.ndarray, names: np.ndarray) -> None:
    """``found`` (H, W) names the row of ``score`` (n, H, W) that is greatest, -1 where all are 0."""
    seen = score.max(axis=0, initial=0.0) > 0.0
    assert (found[~seen] == NONE).all()
    if seen.any():
        assert np.isin(found[seen], names).all()
        row = np.searchsorted(names, np.where(seen, found, names[0]))
        reached = np.take_along_axis(score, row[None], axis=0)[0]
        assert (reached[seen] > score.max(axis=0)[seen] - CLOSE).all()


def is_clear_cut(exact: SimpleNamespace) -> bool:
    """No alpha so near to 1/255 that rounding decides whether a pixel sees anything."""
    return not (np.abs(255.0 * exact.alpha - 1.0) < 1e-3).any()


@settings(max_examples=30, deadline=None, derandomize=True)
@given(scenes(most=30, largest_px=50))
def test_gaussians_instances_and_counts_equal_brute_force(scene: tuple[SplatAsset, Camera]) -> None:
    asset, camera = scene
    instances = np.random.default_rng(0).choice(np.array([-1, 2, 7, 2**31 - 1]), len(asset)).astype(np.int32)
    outputs, exact = render_outputs(asset, camera, instances), brute_force(asset, camera)
    assert outputs.gaussian.dtype == outputs.instance.dtype == outputs.visibility.dtype == np.int32
    surely = (255.0 * exact.alpha > 1.001) & (exact.before > 1.01e-4)
    perhaps = (255.0 * exact.alpha > 0.999) & (exact.before > 0.99e-4)
    assert (surely.sum(axis=(1, 2)) <= outputs.visibility).all()
    assert (outputs.visibility <= perhaps.sum(axis=(1, 2))).all()
    if is_clear_cut(exact):
        assert_greatest(outputs.gaussian, exact.weight, np.arange(len(asset)))
        names = np.unique(instances)
        sums = np.array([exact.weight[instances == name].sum(axis=0) for name in names])
        assert_greatest(outputs.instance, sums.reshape(-1, *camera.shape), names)
    without = render_outputs(asset, camera)
    assert (without.instance == NONE).all()
    np.testing.assert_array_equal(without.gaussian, outputs.gaussian)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(scenes(most=30, largest_px=40, kinds=("mixed", "flat", "thin")))
def test_normals_are_the_weighted_mean_of_the_shortest_axes(scene: tuple[SplatAsset, Camera]) -> None:
    asset, camera = scene
    outputs, exact = render_outputs(asset, camera), brute_force(asset, camera)
    own = np.zeros((len(asset), 3))
    for i, (q, logs, mean) in enumerate(
        zip(asset.quaternions, asset.log_scales.astype(np.float64), asset.means, strict=True)
    ):
        rotation = to_rotation(q[None])[0]
        covariance = rotation @ np.diag(np.exp(2.0 * logs)) @ rotation.T
        own[i] = np.linalg.eigh(covariance)[1][:, 0]  # of the smallest eigenvalue
        own[i] *= -np.sign((mean - camera.centre) @ own[i])
    np.testing.assert_allclose(facing_normals(asset, camera), own, atol=1e-3)
    sums = np.einsum("nhw,nc->hwc", exact.weight, facing_normals(asset, camera))
    length = np.linalg.norm(sums, axis=-1)
    clear = length > 0.02
    expected = sums[clear] / length[clear][:, None]
    np.testing.assert_allclose(outputs.normals[clear], expected, atol=5e-3)
    lengths = np.linalg.norm(outputs.normals, axis=-1)
    assert (np.isclose(lengths, 1.0, atol=1e-5) | (lengths == 0.0)).all()
    assert not outputs.normals[outputs.alpha == 0.0].any()


def wall(z: float, colour: float, normal_axis: int) -> SplatAsset:
    """Opaque discs side by side across the view, at the depth ``z`` before the origin."""
    x, y = np.meshgrid(np.arange(-2, 2, 0.1), np.arange(-2, 2, 0.1))
    count = x.size
    scales = np.full((count, 3), 0.1)
    scales[:, normal_axis] = 1e-4
    return SplatAsset(
        means=np.column_stack([x.ravel(), y.ravel(), np.full(count, z)]),
        log_scales=np.log(scales),
        quaternions=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        logit_opacities=np.full(count, 6.0),
        sh=np.full((count, 1, 3), colour),
    )


def test_a_wall_before_another_hides_it() -> None:
    near, far = wall(1.5, 0.2, 2), wall(3.0, -0.2, 2)
    both = near.concatenated(far)
    instances = np.repeat(np.int32([40, 30]), [len(near), len(far)])
    camera = Camera(50, 70, 60.0, 60.0, 25.0, 35.0, np.eye(4))
    outputs = render_outputs(both, camera, instances)
    assert (outputs.instance == 40).all()
    assert (outputs.gaussian < len(near)).all()
    np.testing.assert_allclose(outputs.normals, np.broadcast_to([0.0, 0.0, -1.0], outputs.normals.shape))
    pixels, _ = camera.project(near.means[outputs.gaussian])
    v, u = np.indices(camera.shape) + 0.5
    reach_px = 3.4 * 0.1 / 1.5 * 60.0
    assert np.linalg.norm(pixels - np.stack([u, v], axis=-1), axis=-1).max() < reach_px
    behind = np.diag([-1.0, 1.0, -1.0, 1.0])
    behind[2, 3] = 4.5
    outputs = render_outputs(both, camera.at(behind), instances)
    assert (outputs.instance == 30).all()
    np.testing.assert_allclose(outputs.normals, np.broadcast_to([0.0, 0.0, 1.0], outputs.normals.shape))


def test_the_sum_of_an_instance_beats_one_stronger_gaussian() -> None:
    stack = SplatAsset(
        means=np.array([[0.0, 0.0, z] for z in (1.0, 1.1, 1.2)]),
        log_scales=np.full((3, 3), 0.0),
        quaternions=np.ones((3, 4)),
        logit_opacities=np.array([-0.4, -0.4, 0.0]),
        sh=np.zeros((3, 1, 3)),
    )
    camera = Camera(8, 8, 8.0, 8.0, 4.0, 4.0, np.eye(4))
    outputs = render_outputs(stack, camera, np.int32([5, 9, 9]))
    assert (outputs.gaussian == 0).all()
    assert (outputs.instance == 9).all()
    assert outputs.visibility.tolist() == [64, 64, 64]
    assert (render_outputs(stack, camera, np.int32([5, -1, -1])).instance == -1).all()


def test_the_rendering_in_the_outputs_is_the_rendering() -> None:
    asset, camera = random_asset(np.random.default_rng(0), 200), small_camera(90, 70)
    behind = np.random.default_rng(1).random((70, 90, 3)).astype(np.float32)
    outputs, expected = render_outputs(asset, camera, background=behind), render(asset, camera, behind)
    for name in ("colour", "alpha", "depth"):
        np.testing.assert_array_equal(getattr(outputs, name), getattr(expected, name))


def test_absurd_gaussians_do_no_harm() -> None:
    asset, camera = random_asset(np.random.default_rng(2), 12), small_camera()
    asset.quaternions[0] = 0.0
    asset.quaternions[1] = np.nan
    asset.log_scales[2] = np.nan
    asset.means[3] = np.nan
    asset.means[4] = 3e38
    outputs = render_outputs(asset, camera, np.arange(12, dtype=np.int32))
    assert np.isfinite(outputs.normals).all()
    np.testing.assert_array_equal(outputs.instance >= 0, outputs.gaussian >= 0)
    assert outputs.visibility[[3, 4]].tolist() == [0, 0]


def test_nothing_is_seen_of_nothing() -> None:
    camera = small_camera()
    outputs = render_outputs(SplatAsset.empty(2), camera, np.zeros(0, np.int32))
    assert (outputs.gaussian == NONE).all() and (outputs.instance == NONE).all()
    assert not outputs.normals.any() and outputs.visibility.shape == (0,)


def test_instances_of_another_number_are_refused() -> None:
    with pytest.raises(AssetError, match=r"instances has the shape \(3,\), not \(60,\)"):
        render_outputs(random_asset(np.random.default_rng(0)), small_camera(), np.zeros(3, np.int32))


def test_the_same_bits_for_every_number_of_threads(with_threads) -> None:
    asset, camera = random_asset(np.random.default_rng(9), 3000), small_camera(160, 120)
    instances = np.arange(3000) % 17
    with_one = with_threads(1, lambda: render_outputs(asset, camera, instances))
    with_all = render_outputs(asset, camera, instances)
    assert all(getattr(with_one, name).tobytes() == getattr(with_all, name).tobytes() for name in MAPS)


def views(count: int) -> list[Camera]:
    """Cameras of different sizes and lenses."""
    cameras = [small_camera(20 + 7 * k, 60 - 5 * k) for k in range(count)]
    return [
        Camera(c.width, c.height, c.fx * (1 + 0.1 * k), c.fy, c.cx, c.cy, c.world_from_camera)
        for k, c in enumerate(cameras)
    ]


def test_a_batch_has_each_cameras_rendering_when_it_is_asked_for() -> None:
    asset, asked = random_asset(np.random.default_rng(0)), []

    def cameras():
        for camera in views(10):
            asked.append(camera)
            yield camera

    for k, (camera, rendering) in enumerate(zip(views(10), render_batch(asset, cameras()), strict=True)):
        assert len(asked) == k + 1
        expected = render(asset, camera)
        for name in ("colour", "alpha", "depth"):
            np.testing.assert_array_equal(getattr(rendering, name), getattr(expected, name))


def test_colours_stand_in_for_the_gaussians_own() -> None:
    """Given the colours that harmonics have there, nothing changes; they may be negative too."""
    asset, camera = random_asset(np.random.default_rng(4), degree=0), small_camera()
    own = np.maximum(asset.base_colours, 0.0)
    packed, rasterizer = PackedGaussians.of(asset), Rasterizer()
    rasterizer.forward(packed, camera, colours=own)
    np.testing.assert_allclose(rasterizer.colour, render(asset, camera).colour, atol=1e-6)
    rasterizer.forward(packed, camera, colours=-own)
    np.testing.assert_allclose(rasterizer.colour, -render(asset, camera).colour, atol=1e-6)

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from splat_reference import random_asset

from r2sego_blender.config.presets import EVERY_PIXEL, UNREGULARISED
from r2sego_blender.config.settings import TrainingSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.splats.rendering.rasterizer import render
from r2sego_blender.splats.training.initialization import from_points
from r2sego_blender.splats.training.observations import Observation
from r2sego_blender.splats.training.supervision import depth_gradients
from r2sego_blender.splats.training.training import train

PLAIN = TrainingSettings(**EVERY_PIXEL, **UNREGULARISED)
BOTH = dataclasses.replace(PLAIN, depth_weight=0.7, normal_weight=0.3, sh_degree=0)


def slanted_plane(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Depth (H, W) and normals (H, W, 3) of a plane in front of the camera, camera frame."""
    normal = np.array([0.3, -0.2, -1.0]) / np.linalg.norm([0.3, -0.2, -1.0])
    depth = -1.8 / (camera.rays() @ normal)
    return depth.astype(np.float32), np.broadcast_to(normal, (*camera.shape, 3)).astype(np.float32)


def camera(width: int = 40, height: int = 30) -> Camera:
    return Camera(width, height, 40.0, 42.0, 0.48 * width, 0.5 * height, np.eye(4))


def test_the_true_depth_has_no_loss() -> None:
    depth, normals = slanted_plane(camera())
    alpha = np.full(depth.shape, 0.9, np.float32)
    loss, by_sum, _ = depth_gradients(depth * alpha, alpha, camera(), depth, np.ones_like(depth), normals, BOTH)
    assert loss < 1e-6
    slope_only = dataclasses.replace(BOTH, depth_weight=0.0)
    loss, by_sum, _ = depth_gradients(
        2.0 * depth * alpha, alpha, camera(), depth, np.ones_like(depth), normals, slope_only
    )
    assert loss < 1e-6  # a plane twice as far has the same normals
    assert np.isfinite(by_sum).all()


@pytest.mark.parametrize("seed", range(3))
def test_the_gradient_is_that_of_the_loss(seed: int) -> None:
    rng = np.random.default_rng(seed)
    depth, normals = slanted_plane(camera())
    alpha = rng.uniform(0.6, 1.0, depth.shape)
    depth_sum = depth * alpha * rng.uniform(0.97, 1.03, depth.shape)
    weight = rng.uniform(0.0, 1.0, depth.shape)

    def loss(s: np.ndarray, a: np.ndarray) -> float:
        return depth_gradients(s, a, camera(), depth, weight, normals, BOTH)[0]

    _, by_sum, by_alpha = depth_gradients(depth_sum, alpha, camera(), depth, weight, normals, BOTH)
    for _ in range(5):
        step = 1e-7
        direction = rng.normal(size=(2, *depth.shape))
        ahead = loss(depth_sum + step * direction[0], alpha + step * direction[1])
        behind = loss(depth_sum - step * direction[0], alpha - step * direction[1])
        expected = (ahead - behind) / (2 * step)
        ours = (by_sum * direction[0]).sum() + (by_alpha * direction[1]).sum()
        assert ours == pytest.approx(expected, rel=2e-3, abs=1e-5)


def test_unknown_depth_and_what_is_not_covered_teach_nothing() -> None:
    depth, normals = slanted_plane(camera())
    alpha = np.full(depth.shape, 0.9, np.float32)
    alpha[:10] = 0.2
    depth[20:] = 0.0
    weight = (depth > 0.0).astype(np.float32)
    _, by_sum, by_alpha = depth_gradients(1.1 * np.ones_like(depth), alpha, camera(), depth, weight, normals, BOTH)
    assert not by_sum[:10].any() and not by_alpha[:10].any()
    assert not by_sum[21:].any()
    assert by_sum[12:18].any()


def test_training_with_depth_puts_the_surface_where_it_is() -> None:
    lens = camera(64, 48)
    depth, normals = slanted_plane(lens)
    grey = np.full((*lens.shape, 3), 0.5, np.float32)  # no texture: colour says nothing of depth
    points = lens.unproject(depth).reshape(-1, 3)[::5] * 1.15
    settings = dataclasses.replace(BOTH, depth_weight=1.0, position_learning_rate=2e-2)
    start = from_points(points, np.full(points.shape, 0.5), settings, np.random.default_rng(0))
    view = Observation(lens, grey, depth=depth, normals=normals)

    def error(asset) -> float:
        image = render(asset, lens)
        return float(np.median(np.abs(image.depth - depth)[image.alpha > 0.5]))

    blind = dataclasses.replace(settings, depth_weight=0.0, normal_weight=0.0)
    taught = error(train(start, [view], 200, settings, np.random.default_rng(0)))
    untaught = error(train(start, [view], 200, blind, np.random.default_rng(0)))
    assert taught < 0.03
    assert taught < 0.3 * untaught


def test_random_scenes_give_finite_gradients() -> None:
    lens = Camera(45, 35, 40.0, 40.0, 22.0, 17.0, look_at([0.1, -0.2, -1.0], [0.0, 0.0, 2.0], up=(0.0, -1.0, 0.0)))
    image = render(random_asset(np.random.default_rng(0)), lens)
    depth = np.full(lens.shape, 2.0, np.float32)
    normals = np.zeros((*lens.shape, 3), np.float32)
    _, by_sum, by_alpha = depth_gradients(
        image.depth * image.alpha, image.alpha, lens, depth, np.ones_like(depth), normals, BOTH
    )
    assert np.isfinite(by_sum).all() and np.isfinite(by_alpha).all()

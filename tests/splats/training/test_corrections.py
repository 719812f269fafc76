from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from splat_reference import random_asset, small_camera

from r2sego_blender.config.presets import EVERY_PIXEL, UNREGULARISED
from r2sego_blender.config.settings import TrainingSettings
from r2sego_blender.core.cameras import rotation_angle_rad
from r2sego_blender.splats.kernels.packing import PackedGaussians
from r2sego_blender.splats.rendering.rasterizer import Rasterizer, render
from r2sego_blender.splats.training.corrections import Correction
from r2sego_blender.splats.training.observations import Observation
from r2sego_blender.splats.training.training import train

PLAIN = TrainingSettings(**EVERY_PIXEL, **UNREGULARISED)
SETTINGS = dataclasses.replace(PLAIN, sh_degree=0, exposure_learning_rate=5e-3, pose_learning_rate=1e-3)


def test_a_wrong_pose_is_found_from_the_image() -> None:
    asset, true = random_asset(np.random.default_rng(1), 120), small_camera(90, 70)
    image = render(asset, true).colour
    nudge = np.eye(4)
    nudge[:3, :3] = Rotation.from_rotvec([0.01, -0.012, 0.008]).as_matrix()
    nudge[:3, 3] = [0.01, -0.006, 0.008]
    start = dataclasses.replace(true, world_from_camera=true.world_from_camera @ nudge)
    correction = Correction(SETTINGS, refines_exposure=False, refines_pose=True)
    packed, rasterizer = PackedGaussians.of(asset), Rasterizer()
    for _ in range(250):
        rasterizer.forward(packed, correction.camera(start))
        gradient = 2.0 * (rasterizer.colour - image) / image.size
        correction.learn_pose(rasterizer.backward(gradient).pose)
    found = correction.camera(start)

    def apart(camera) -> tuple[float, float]:
        turn = rotation_angle_rad(camera.world_from_camera, true.world_from_camera)
        return np.linalg.norm(camera.centre - true.centre), turn

    assert apart(found)[0] < 0.25 * apart(start)[0]
    assert apart(found)[1] < 0.25 * apart(start)[1]


def test_a_darker_frame_is_exposed_not_learnt() -> None:
    asset, camera = random_asset(np.random.default_rng(2), 120, degree=0), small_camera(90, 70)
    image = np.clip(render(asset, camera).colour, 0.0, 1.0)
    dark = (0.8 * image + 0.02).astype(np.float32)
    views = [Observation(camera, image), Observation(camera, dark, refines_exposure=True)]
    plain = [views[0], Observation(camera, dark)]
    rates = dataclasses.replace(SETTINGS, colour_learning_rate=5e-3)
    with_exposure = render(train(asset, views, 300, rates, np.random.default_rng(0)), camera).colour
    without = render(train(asset, plain, 300, rates, np.random.default_rng(0)), camera).colour
    assert np.abs(with_exposure - image).mean() < 0.6 * np.abs(without - image).mean()


def test_the_exposure_gradient_is_the_chain_rule() -> None:
    rng = np.random.default_rng(0)
    planes, upstream = rng.random((2, 3, 10, 12)).astype(np.float32)
    correction = Correction(SETTINGS, refines_exposure=True, refines_pose=False)
    correction._exposure.values = np.array([[1.1, 0.9, 1.2], [0.0, 0.1, -0.1]])
    gain, offset = correction.exposure
    np.testing.assert_allclose(
        correction.expose(planes), planes * gain[:, None, None] + offset[:, None, None], rtol=1e-6
    )
    gradient = upstream.copy()
    correction.learn_exposure(planes, gradient)
    np.testing.assert_allclose(gradient, upstream * gain[:, None, None], rtol=1e-6)
    # Adam's first step goes against the sign of each gradient, by the rate.
    moved = correction._exposure.values - [gain, offset]
    by_gain = (upstream * planes).sum(axis=(1, 2))
    np.testing.assert_allclose(moved[0], -5e-3 * np.sign(by_gain), rtol=1e-3)
    np.testing.assert_allclose(moved[1], -5e-3 * np.sign(upstream.sum(axis=(1, 2))), rtol=1e-3)


@pytest.mark.parametrize("gradient", [1e6, -1e6])
def test_a_pose_never_runs_away(gradient: float) -> None:
    camera = small_camera()
    correction = Correction(dataclasses.replace(SETTINGS, pose_learning_rate=0.5), False, refines_pose=True)
    for _ in range(50):
        correction.learn_pose(np.full(6, gradient))
    moved = correction.camera(camera)
    assert np.linalg.norm(moved.centre - camera.centre) < 0.2
    turn = rotation_angle_rad(moved.world_from_camera, camera.world_from_camera)
    assert turn <= np.radians(3.0) + 1e-6

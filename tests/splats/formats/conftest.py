"""An asset of many shapes, seen by two cameras, for the files of every format."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.metrics import psnr
from r2sego_blender.splats.rendering.rasterizer import render

COUNT = 400


@pytest.fixture(scope="session")
def asset() -> SplatAsset:
    """Long, flat and round Gaussians of degree 3 in a room of 3 m, some opaque, some faint."""
    rng = np.random.default_rng(7)
    sh = np.concatenate([rng.normal(scale=0.8, size=(COUNT, 1, 3)), rng.normal(scale=0.15, size=(COUNT, 15, 3))], 1)
    return SplatAsset(
        means=rng.uniform([-1.5, -1.5, 0.0], [1.5, 1.5, 2.0], (COUNT, 3)),
        log_scales=rng.uniform(-4.0, -1.5, (COUNT, 3)),
        quaternions=rng.normal(size=(COUNT, 4)) * rng.uniform(0.5, 2.0, (COUNT, 1)),
        logit_opacities=rng.uniform(-2.0, 5.0, COUNT),
        sh=sh,
    )


@pytest.fixture(scope="session")
def cameras() -> tuple[Camera, Camera]:
    target = np.array([0.0, 0.0, 1.0])
    poses = [look_at(np.array(centre), target) for centre in ([2.5, -2.5, 1.6], [-3.0, 1.0, 1.4])]
    return tuple(Camera(160, 120, 120.0, 120.0, 80.0, 60.0, pose) for pose in poses)


@pytest.fixture(scope="session")
def fidelity_db(cameras: tuple[Camera, Camera]) -> Callable[..., float]:
    """The lower PSNR of an asset against another, of the two views.

    ``frame_from_world`` tells where the first one stands; its cameras move along.
    """

    def measured(found: SplatAsset, wanted: SplatAsset, frame_from_world: np.ndarray | None = None) -> float:
        values = []
        for camera in cameras:
            reference = render(wanted, camera).colour.copy()
            if frame_from_world is not None:
                camera = replace(camera, world_from_camera=frame_from_world @ camera.world_from_camera)
            values.append(psnr(render(found, camera).colour, reference))
        return min(values)

    return measured


@pytest.fixture(autouse=True)
def no_warnings() -> Iterator[None]:
    """Damaged numbers are dropped without a word of NumPy's."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        yield

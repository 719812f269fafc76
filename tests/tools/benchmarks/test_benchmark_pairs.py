"""The pairs a kernel counts are those of the textbook's formulas, pixel by pixel."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.kernels.packing import PackedGaussians
from r2sego_blender.splats.rendering.rasterizer import Rasterizer
from tools.benchmarks.pairs import count_work


def random_asset(rng: np.random.Generator, count: int, opacity: float) -> SplatAsset:
    return SplatAsset(
        means=rng.uniform([-2.0, -1.5, -0.5], [2.0, 1.5, 4.0], (count, 3)),
        log_scales=rng.uniform(-4.0, -1.0, (count, 3)),
        quaternions=rng.normal(size=(count, 4)),
        logit_opacities=rng.uniform(opacity - 4.0, opacity + 4.0, count),
        sh=rng.normal(scale=0.4, size=(count, 1, 3)),
    )


def camera_of(width: int, height: int) -> Camera:
    pose = look_at(np.array([0.05, -0.1, -0.3]), np.array([0.1, 0.05, 2.0]), up=(0.0, -1.0, 0.1))
    return Camera(width, height, 0.8 * width, 0.9 * width, 0.48 * width, 0.53 * height, pose)


def brute_force(asset: SplatAsset, camera: Camera) -> tuple[int, int]:
    """Pairs and contributing Gaussians: every pixel against every Gaussian, float64 (EWA, as 3DGS)."""
    transform = camera.camera_from_world
    points = asset.means.astype(np.float64) @ transform[:3, :3].T + transform[:3, 3]
    x, y, z = points.T
    bounds = [
        (-c / f - 0.15 * size / f, (size - c) / f + 0.15 * size / f)
        for f, c, size in ((camera.fx, camera.cx, camera.width), (camera.fy, camera.cy, camera.height))
    ]
    v, u = np.mgrid[: camera.height, : camera.width] + 0.5
    transmittance = np.ones(camera.shape)
    pairs, seen = 0, 0
    for i in np.argsort(z, kind="stable"):
        if z[i] <= 0.2:
            continue
        axes = Rotation.from_quat(np.roll(asset.quaternions[i], -1)).as_matrix() * np.exp(asset.log_scales[i])
        slopes = [np.clip(p[i] / z[i], *bound) for p, bound in zip((x, y), bounds, strict=True)]
        jacobian = np.array([[camera.fx, 0, -camera.fx * slopes[0]], [0, camera.fy, -camera.fy * slopes[1]]])
        screen = jacobian / z[i] @ transform[:3, :3] @ axes
        conic = np.linalg.inv(screen @ screen.T + 0.3 * np.eye(2))
        d = np.stack([u - camera.fx * x[i] / z[i] - camera.cx, v - camera.fy * y[i] / z[i] - camera.cy])
        power = -0.5 * np.einsum("iyx,ij,jyx->yx", d, conic, d)
        alpha = np.minimum(asset.opacities[i] * np.exp(power), 0.99)
        counts = (alpha >= 1 / 255) & (transmittance > 1e-4)
        transmittance *= 1.0 - np.where(counts, alpha, 0.0)
        pairs, seen = pairs + int(counts.sum()), seen + bool(counts.any())
    return pairs, seen


@pytest.mark.parametrize(("size", "opacity"), [((45, 35), 1.0), ((96, 64), 4.0)])
def test_counting_equals_brute_force(size, opacity):
    asset, camera = random_asset(np.random.default_rng(3), 250, opacity), camera_of(*size)
    rasterizer = Rasterizer()
    rasterizer.forward(PackedGaussians.of(asset), camera, degree=0, with_depth=False)
    work = count_work(rasterizer.tile_entries, camera.shape)
    pairs, contributing = brute_force(asset, camera)
    # The kernels' float32 decides a few pixels at an ellipse's rim the other way.
    assert work.pairs == pytest.approx(pairs, rel=2e-4)
    assert work.contributing == pytest.approx(contributing, abs=1)
    assert work.contributing <= work.visible <= len(asset)


def test_an_empty_asset_has_no_pairs():
    asset, camera = random_asset(np.random.default_rng(0), 4, -40.0), camera_of(40, 30)
    rasterizer = Rasterizer()
    rasterizer.forward(PackedGaussians.of(asset), camera, degree=0, with_depth=False)
    work = count_work(rasterizer.tile_entries, camera.shape)
    assert (work.pairs, work.contributing, work.visible) == (0, 0, 0)

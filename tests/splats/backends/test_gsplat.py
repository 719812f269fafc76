"""gsplat as an engine: beside our kernels on the same scene, with a plain reference where there is no GPU.

``rasterization`` has gsplat's signature and conventions and is differentiated by torch; so what is
tested without a GPU is all but gsplat's own kernels. Those are tested where there are any.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Iterator

import numpy as np
import pytest
import torch
from splat_reference import on_screen, random_asset, small_camera, weights

from r2sego_blender.config.presets import UNREGULARISED
from r2sego_blender.config.settings import TrainingSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import SettingsError
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.backends import gsplat
from r2sego_blender.splats.backends.cpu import CpuBackend
from r2sego_blender.splats.backends.slot import SplatBackend, make_backend, require_backend
from r2sego_blender.splats.kernels.adam import AdamState
from r2sego_blender.splats.kernels.packing import PackedGaussians, unpack
from r2sego_blender.splats.kernels.projection import NEAREST_M
from r2sego_blender.splats.kernels.tiles import planes_of
from r2sego_blender.splats.metrics import psnr
from r2sego_blender.splats.rendering.rasterizer import render
from r2sego_blender.splats.training.observations import Observation
from r2sego_blender.splats.training.training import train

GROUPS = ("means", "log_scales", "quaternions", "logit_opacities", "sh")
BLACK = (0.0, 0.0, 0.0)


def rasterization(
    means,
    quats,
    scales,
    opacities,
    colors,
    viewmats,
    Ks,  # noqa: N803
    width,
    height,
    near_plane,
    eps2d,
    sh_degree,
    packed,
    render_mode,
):
    """gsplat's of one camera: images (1, H, W, 3 or 4), alphas (1, H, W, 1), and ``means2d`` (1, N, 2)."""
    assert near_plane == NEAREST_M and not packed and render_mode in ("RGB", "RGB+D")
    (fx, _, cx), (_, fy, cy), _ = Ks[0].tolist()
    pose = np.linalg.inv(viewmats[0].detach().numpy().astype(np.float64))
    camera = Camera(width, height, fx, fy, cx, cy, pose)
    unused = torch.zeros(len(means), dtype=torch.float64)
    harmonics = colors[:, : (sh_degree + 1) ** 2].double()
    screen = on_screen(
        means.double(), scales.double().log(), quats.double(), unused, harmonics, camera, viewmats[0].double(), eps2d
    )
    means2d = torch.zeros(1, len(means), 2, dtype=torch.float64)
    means2d = means2d.index_put((torch.zeros_like(screen.number), screen.number), screen.centre)
    screen.centre, screen.opacity = means2d[0, screen.number], opacities.double()[screen.number]
    weight, transmittance = weights(screen, camera)
    channels = [screen.colour, *([screen.depth[:, None]] if "D" in render_mode else [])]
    image = torch.einsum("nhw,nc->hwc", weight, torch.cat(channels, dim=1))
    return image[None].float(), (1.0 - transmittance)[None, ..., None].float(), {"means2d": means2d}


def on_cpu() -> tuple[Callable, torch.device]:
    return rasterization, torch.device("cpu")


@pytest.fixture
def without_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    """gsplat's place taken by the reference."""
    monkeypatch.setattr(gsplat, "cuda_rasterization", on_cpu)


@pytest.fixture
def on_gpu() -> Iterator[None]:
    """gsplat itself, or a skipped test that says what is missing."""
    try:
        gsplat.cuda_rasterization()
    except SettingsError as error:
        pytest.skip(f"{error.what}: gsplat's own kernels are not compared with ours here")


def engines(asset: SplatAsset) -> list[tuple[SplatBackend, PackedGaussians, AdamState]]:
    """Our kernels and gsplat, each on Gaussians of its own."""
    made = []
    for name in ("cpu", "gsplat"):
        packed = PackedGaussians.of(asset)
        state = AdamState.of(packed)
        made.append((make_backend(name, packed, state), packed, state))
    return made


def inside(planes: np.ndarray, camera: Camera) -> np.ndarray:
    return planes[:, : camera.height, : camera.width]


def quality_db(a: np.ndarray, b: np.ndarray) -> float:
    return psnr(np.clip(a, 0.0, 1.0), np.clip(b, 0.0, 1.0))


@pytest.mark.parametrize("degree", [0, 1, 3])
@pytest.mark.parametrize("dilation_px2", [0.3, 0.3 / 9.0])
def test_images_are_those_of_our_kernels(without_gpu, degree: int, dilation_px2: float) -> None:
    asset, camera = random_asset(np.random.default_rng(0)), small_camera()
    behind = np.random.default_rng(1).random((*camera.shape, 3), np.float32)
    for background in (BLACK, (0.2, 0.5, 0.9), behind, planes_of(behind)):
        ours, theirs = (engine for engine, _, _ in engines(asset))
        for engine in (ours, theirs):
            engine.forward(camera, background, degree, True, dilation_px2)
        a, b = inside(ours.planes, camera), inside(theirs.planes, camera)
        assert quality_db(a[:3], b[:3]) > 60.0
        np.testing.assert_allclose(a, b, atol=2e-3)
        assert b[4].max() > 1.0  # depth


def upstream(engine: SplatBackend, camera: Camera, seed: int) -> None:
    gradients = inside(engine.gradient_planes, camera)
    gradients[:] = np.random.default_rng(seed).normal(size=gradients.shape)


def remembered(packed: PackedGaussians, state: AdamState) -> dict[str, np.ndarray]:
    chunks = {
        "values": packed.chunks,
        "first": state.first,
        "second": state.second,
        "statistics": state.statistics,
        "steps": state.steps[:, None],
    }
    return {name: unpack(values, len(packed)).copy() for name, values in chunks.items()}


@pytest.mark.parametrize("planes", [(False, False), (True, False), (True, True)])
def test_steps_move_the_same_gaussians_by_the_same(without_gpu, planes: tuple[bool, bool]) -> None:
    asset, camera = random_asset(np.random.default_rng(0), 50), small_camera()
    (ours, *our_state), (theirs, *their_state) = engines(asset)
    rates, left_out = np.full(our_state[0].chunks.shape[1], 1e-4, np.float32), np.zeros((4, 16), bool)
    left_out[1, 3:9] = True
    for step in range(3):
        for engine in (ours, theirs):
            with engine.leaving_out(left_out if step == 1 else None):
                engine.forward(camera, (0.2, 0.5, 0.9), 2, planes[1], 0.3)
                upstream(engine, camera, step)
                engine.step(rates, 0.3, 0.2, *planes)
                engine.bound_log_scales(-1.0)
        np.testing.assert_allclose(ours.pose_gradient(), theirs.pose_gradient(), rtol=2e-3, atol=0.5)
    with theirs.lent():
        a, b = remembered(*our_state), remembered(*their_state)
    same = (a["steps"] == b["steps"])[:, 0]
    assert same.mean() > 0.95  # those at the edge of 1/255 may count in one alone
    assert len(np.unique(a["steps"])) > 2 and a["values"][:, 3:6].max() == np.float32(-1.0)
    np.testing.assert_allclose(a["values"][same], b["values"][same], atol=3e-5)
    for name in ("first", "second", "statistics"):
        scale = np.maximum(np.abs(a[name]).max(axis=0), 1e-12)
        np.testing.assert_allclose(a[name][same] / scale, b[name][same] / scale, atol=5e-3)


def test_the_same_object_is_read_between_steps_and_changed_while_it_is_lent(without_gpu) -> None:
    camera, (_, (engine, packed, state)) = small_camera(), engines(random_asset(np.random.default_rng(0), 40))
    before = packed.chunks.copy()
    engine.forward(camera, BLACK, 3, False, 0.3)
    upstream(engine, camera, 0)
    engine.step(np.full(packed.chunks.shape[1], 1e-2, np.float32), 0.0, 0.0, False, False)
    np.testing.assert_array_equal(packed.chunks, before)
    assert engine.gaussians is packed and (packed.chunks != before).any()
    with engine.lent():
        assert state.steps.any()
        packed.chunks[:, 10] = -1e30
        packed.order = packed.order[:30]
    assert len(engine) == 30
    engine.forward(camera, BLACK, 3, False, 0.3)
    assert not inside(engine.planes, camera)[:3].any()


def scene(count: int, size: tuple[int, int]) -> tuple[SplatAsset, list[Observation]]:
    """An asset to start from, and views of another one with backgrounds, depth and corrections."""
    rng = np.random.default_rng(0)
    true = random_asset(rng, count, degree=1)
    start = true.with_degree(0).copy()
    start.means[:] += rng.normal(scale=0.03, size=start.means.shape)
    start.sh[:] += rng.normal(scale=0.5, size=start.sh.shape)
    views = []
    for k, x in enumerate(np.linspace(-0.8, 0.8, 4)):
        width, height = size
        pose = look_at([x, -0.2, -1.5], [0.0, 0.0, 2.0])
        seen = render(true, camera := Camera(width, height, width, width, width / 2, height / 2, pose))
        views.append(
            Observation(
                camera,
                np.clip(seen.colour, 0, 1),
                depth=seen.depth,
                background=np.full((*camera.shape, 3), 0.1, np.float32) if k % 2 else None,
                opaque=(seen.alpha > 0.9).astype(np.float32),
                refines_exposure=k == 3,
                refines_pose=k == 3,
            )
        )
    return start, views


def trained_db(start: SplatAsset, views: list[Observation], steps: int, settings: TrainingSettings) -> list[float]:
    """The quality after a training with our kernels, and with gsplat."""
    found = []
    for backend in ("cpu", "gsplat"):
        chosen = dataclasses.replace(settings, backend=backend)
        asset = train(start, views, steps, chosen, np.random.default_rng(3))
        behind = [BLACK if view.background is None else view.background for view in views]
        seen = [render(asset, v.camera, b).colour for v, b in zip(views, behind, strict=True)]
        found.append(float(np.mean([quality_db(c, v.image) for c, v in zip(seen, views, strict=True)])))
    return found


SETTINGS = dataclasses.replace(
    TrainingSettings(**UNREGULARISED),
    sh_degree=1,
    every_third_pixel_share=0.2,
    every_second_pixel_share=0.2,
    depth_weight=0.05,
    exposure_learning_rate=1e-3,
    pose_learning_rate=1e-4,
)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"dropout_share": 0.2, "max_scale_m": 0.3, "opacity_regularization": 0.01, "scale_regularization": 0.01},
        {"densification": "growth", "max_gaussians": 1000, "densify_every_steps": 10},
        {"densification": "relocation", "max_gaussians": 1000, "densify_every_steps": 10},
    ],
    ids=["plain", "regularised", "growth", "relocation"],
)
def test_training_comes_as_far_as_with_our_kernels(without_gpu, changes: dict) -> None:
    start, views = scene(40, (48, 36))
    settings = dataclasses.replace(SETTINGS, **changes)
    (before_db, _), (ours_db, theirs_db) = (trained_db(start, views, steps, settings) for steps in (1, 40))
    assert abs(ours_db - before_db) > 0.7
    assert abs(ours_db - theirs_db) < 0.05


def test_a_training_is_watched_without_gaussians_being_fetched_each_time(without_gpu, monkeypatch) -> None:
    start, views = scene(40, (48, 36))
    fetched, fetch = [], gsplat.GsplatBackend._fetch
    monkeypatch.setattr(gsplat.GsplatBackend, "_fetch", lambda *arguments: (fetched.append(1), fetch(*arguments)))
    sizes = []

    def watch(step: int, gaussians: Callable[[], PackedGaussians]) -> bool:
        if step == 3:
            sizes.append(len(gaussians()))
        return False

    settings = dataclasses.replace(SETTINGS, backend="gsplat")
    train(start, views, 5, settings, np.random.default_rng(0), watch=watch)
    assert sizes == [40] and len(fetched) == 2


def test_an_engine_that_cannot_run_is_an_error_with_a_cure_and_never_another(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "gsplat", None)
    start, views = scene(40, (48, 36))
    for refused in (
        lambda: require_backend("gsplat"),
        lambda: train(start, views, 1, dataclasses.replace(SETTINGS, backend="gsplat"), np.random.default_rng(0)),
    ):
        with pytest.raises(SettingsError) as error:
            refused()
        assert error.value.where == "training.backend"
        assert "cuda" in error.value.cure and "cpu" in error.value.cure
    require_backend("cpu")
    packed = PackedGaussians.of(start)
    assert isinstance(make_backend(TrainingSettings().backend, packed, AdamState.of(packed)), CpuBackend)


def test_gsplats_pictures_are_those_of_our_kernels(on_gpu) -> None:
    for count, size in ((60, (48, 36)), (20000, (640, 480))):
        start, views = scene(count, size)
        for view in views:
            ours, theirs = (engine for engine, _, _ in engines(start))
            for engine in (ours, theirs):
                engine.forward(view.camera, (0.2, 0.5, 0.9), 3, True, 0.3)
            a, b = inside(ours.planes, view.camera), inside(theirs.planes, view.camera)
            assert quality_db(a[:3], b[:3]) >= 40.0
            assert np.median(np.abs(a[4] - b[4])) < 1e-3


@pytest.mark.parametrize("densification", ["none", "growth"])
def test_training_on_gsplat_comes_as_far_as_with_our_kernels(on_gpu, densification: str) -> None:
    start, views = scene(5000, (320, 240))
    settings = dataclasses.replace(SETTINGS, densification=densification, max_gaussians=8000)
    ours_db, theirs_db = trained_db(start, views, 400, settings)
    assert abs(ours_db - theirs_db) < 0.2

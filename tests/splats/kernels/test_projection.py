from __future__ import annotations

import math
from types import SimpleNamespace

import numba
import numpy as np
import torch
from hypothesis import given, settings
from splat_reference import alphas, frozen, on_screen, random_asset, scenes, small_camera

from r2sego_blender.core.cameras import Camera
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.kernels.packing import PackedGaussians
from r2sego_blender.splats.kernels.projection import (
    DEPTH,
    EIGHTH,
    EXTENT_Y,
    FACTOR_A,
    FACTOR_B,
    FACTOR_C,
    FORM_SCALE,
    INVERSE_A,
    NEAREST_M,
    RED,
    SKEW_Y,
    TILES_X,
    TILES_Y,
    U,
    V,
    lens_of,
    project,
)
from r2sego_blender.splats.kernels.tiles import TILE_PX
from r2sego_blender.splats.vector_language.aligned_memory import aligned
from r2sego_blender.splats.vector_language.vectors import LANES

SMALLEST_ALPHA = 1.0 / 255.0


def projected(asset: SplatAsset, camera: Camera, degree: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """The records (N, 16) float64 in the asset's order, and which are visible (N,)."""
    packed = PackedGaussians.of(asset)
    values, lens = packed.values, lens_of(camera)
    records, bits = aligned((len(values) * LANES, 16)), np.zeros(len(values), np.int32)
    degree = min(degree, asset.degree)
    project(
        values.ctypes.data,
        len(values),
        values.strides[0],
        degree,
        lens.ctypes.data,
        records.ctypes.data,
        bits,
        numba.get_num_threads(),
    )
    flags = (bits[:, None] >> np.arange(LANES) & 1).ravel().astype(bool)
    assert not flags[len(asset) :].any()
    in_order, visible = np.zeros((len(asset), 16)), np.zeros(len(asset), bool)
    in_order[packed.order], visible[packed.order] = records[: len(asset)], flags[: len(asset)]
    return in_order, visible


def tiles(record: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 2) each: the first and the last column and row of tiles."""
    words = np.ascontiguousarray(record[:, [TILES_X, TILES_Y]], np.float32).view(np.int32)
    return words & 0xFFFF, words >> 16


@settings(max_examples=80, deadline=None, derandomize=True)
@given(scenes())
def test_records_equal_a_plain_projection(scene: tuple[SplatAsset, Camera]) -> None:
    asset, camera = scene
    records, visible = projected(asset, camera)
    screen = vars(on_screen(*frozen(asset), camera))
    chosen = visible[screen["number"].numpy()]
    assert chosen.sum() == visible.sum()
    at = SimpleNamespace(**{name: values.numpy()[chosen] for name, values in screen.items()})
    record = records[at.number]

    # World coordinates of some metres are known to a millionth in float32.
    error_px = 1e-5 * max(camera.fx, camera.fy) / at.depth[:, None]
    assert (np.abs(record[:, [U, V]] - at.centre) < error_px + 1e-5 * np.abs(at.centre)).all()
    factor = np.zeros((len(record), 2, 2))
    factor[:, 0, 0], factor[:, 0, 1] = record[:, FACTOR_A], record[:, FACTOR_B]
    factor[:, 1, 1] = record[:, FACTOR_C]
    root = np.linalg.cholesky(at.covariance)
    whitened = factor @ root  # its square is FORM_SCALE times the identity
    error = whitened.transpose(0, 2, 1) @ whitened / FORM_SCALE - np.eye(2)
    assert np.abs(error).max(initial=0.0) < 1e-3
    np.testing.assert_allclose(8.0 * record[:, EIGHTH], np.log2(at.opacity), atol=2e-6)
    np.testing.assert_allclose(record[:, RED : RED + 3], at.colour, atol=2e-5)
    np.testing.assert_allclose(record[:, DEPTH], at.depth, rtol=2e-5)

    reach2 = 2.0 * np.log(at.opacity / SMALLEST_ALPHA)[:, None]
    extents = np.sqrt(np.maximum(reach2 * at.covariance[:, [0, 1], [0, 1]], 0.0))
    np.testing.assert_allclose(record[:, EXTENT_Y], extents[:, 1], rtol=1e-3, atol=1e-3)
    np.testing.assert_allclose(record[:, INVERSE_A] * record[:, FACTOR_A], 1.0, rtol=1e-5)
    slack = 1e-3 * (1.0 + extents) + error_px + 1e-5 * np.abs(at.centre)
    sides = camera.width - 1, camera.height - 1

    def tiles_at(px: np.ndarray) -> np.ndarray:
        return np.clip(px - 0.5, 0.0, sides) // TILE_PX

    for found, border in zip(tiles(record), (at.centre - extents, at.centre + extents), strict=True):
        assert (found >= tiles_at(border - slack)).all() and (found <= tiles_at(border + slack)).all()
    skew = at.covariance[:, 0, 1] / at.covariance[:, 0, 0] * extents[:, 0]
    np.testing.assert_allclose(record[:, SKEW_Y], skew, rtol=1e-3, atol=1e-3 * extents[:, 1].max(initial=1.0))


@settings(max_examples=80, deadline=None, derandomize=True)
@given(scenes())
def test_no_gaussian_with_a_pixel_is_missed(scene: tuple[SplatAsset, Camera]) -> None:
    asset, camera = scene
    _, visible = projected(asset, camera)
    screen = on_screen(*frozen(asset), camera)
    strongest = alphas(screen, camera).flatten(1).amax(1).numpy()
    assert visible[screen.number.numpy()[strongest > 1.001 * SMALLEST_ALPHA]].all()
    # Nor is one kept whose ellipse's box lies outside the image.
    reach = torch.sqrt(2.0 * torch.log(255.0 * screen.opacity).clamp(min=0.0))
    extents = reach[:, None] * screen.covariance[:, [0, 1], [0, 1]].sqrt() * 1.001 + 0.01
    size = torch.tensor([camera.width, camera.height])
    touches = ((screen.centre + extents > 0.5) & (screen.centre - extents < size - 0.5)).all(1)
    assert not visible[screen.number.numpy()[~touches.numpy()]].any()


def one(camera: Camera, distance_m: float, **changes: object) -> SplatAsset:
    """A Gaussian straight ahead."""
    values = {
        "means": (camera.centre + distance_m * camera.forward)[None],
        "log_scales": np.full((1, 3), -2.0),
        "quaternions": np.array([[1.0, 0.0, 0.0, 0.0]]),
        "logit_opacities": np.array([2.0]),
        "sh": np.ones((1, 1, 3)),
    }
    return SplatAsset(**(values | changes))


def test_what_is_near_behind_or_faint_is_not_visible() -> None:
    camera = Camera(40, 30, 30.0, 30.0, 20.0, 15.0, small_camera().world_from_camera)
    for distance_m, seen in ((1.01 * NEAREST_M, True), (0.99 * NEAREST_M, False), (-1.0, False), (0.0, False)):
        assert projected(one(camera, distance_m), camera)[1].all() == seen
    threshold = math.log(SMALLEST_ALPHA / (1.0 - SMALLEST_ALPHA))
    for logit, seen in ((threshold + 1e-4, True), (threshold - 1e-4, False), (-1e30, False), (1e30, True)):
        assert projected(one(camera, 2.0, logit_opacities=np.array([logit])), camera)[1].all() == seen


def test_a_round_gaussian_has_the_size_of_the_pinhole_image() -> None:
    camera = Camera(60, 80, 50.0, 70.0, 30.0, 40.0, np.eye(4))
    records, _ = projected(one(camera, 4.0, log_scales=np.full((1, 3), np.log(0.2))), camera)
    variance_x, variance_y = (50.0 * 0.2 / 4.0) ** 2 + 0.3, (70.0 * 0.2 / 4.0) ** 2 + 0.3
    reach2 = 2.0 * math.log(255.0 / (1.0 + math.exp(-2.0)))
    assert records[0, U] == 30.0 and records[0, V] == 40.0
    first, last = (side[0, 0] for side in tiles(records))
    reach_px = math.sqrt(reach2 * variance_x)
    assert (first, last) == ((30.0 - reach_px) // TILE_PX, (30.0 + reach_px) // TILE_PX)
    np.testing.assert_allclose(records[0, EXTENT_Y], math.sqrt(reach2 * variance_y), rtol=1e-5)
    assert abs(records[0, SKEW_Y]) < 1e-6 and abs(records[0, FACTOR_B]) < 1e-9


def test_colours_are_never_negative_and_always_finite() -> None:
    camera = small_camera()
    for value, shown in ((-50.0, 0.0), (3e38, 1e4), (np.nan, 0.0)):
        records, visible = projected(one(camera, 2.0, sh=np.full((1, 1, 3), value)), camera)
        assert visible.all()
        np.testing.assert_array_equal(records[0, RED : RED + 3], np.float32(shown))


def test_a_degree_cuts_the_harmonics_off() -> None:
    asset, camera = random_asset(np.random.default_rng(0)), small_camera()
    for degree in range(4):
        full, visible = projected(asset, camera, degree)
        cut, _ = projected(asset.with_degree(degree), camera)
        np.testing.assert_array_equal(full[visible], cut[visible])

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from splat_reference import parameters, random_asset, rasterize, scenes, small_camera

from r2sego_blender.core.cameras import Camera
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.kernels.packing import PackedGaussians
from r2sego_blender.splats.kernels.projection import DEPTH, EIGHTH, EIGHTH_SMALLEST, FACTOR_A, FACTOR_B, FACTOR_C, U, V
from r2sego_blender.splats.kernels.tiles import BLOCK_PX, BLOCKS_A_SIDE, TILE_PX
from r2sego_blender.splats.rendering.rasterizer import Rasterizer, TileEntries

HELD_OUT_PX = 0.06
"""More than the binning's own slack: farther from the ellipse no block may count as touched."""


def entries_of(asset: SplatAsset, camera: Camera) -> TileEntries:
    rasterizer = Rasterizer()
    rasterizer.forward(PackedGaussians.of(asset), camera)
    return rasterizer.tile_entries


def numbers(tiles: TileEntries) -> np.ndarray:
    return (tiles.order & np.uint64(0xFFFFFFFF)).astype(np.int64)


def touched_blocks(tiles: TileEntries, count: int) -> np.ndarray:
    """(N, rows, columns) bool over whole tiles: the blocks of each packed Gaussian."""
    tiles_y = (len(tiles.starts) - 1) // tiles.tiles_x
    touched = np.zeros((count, tiles_y * BLOCKS_A_SIDE, tiles.tiles_x * BLOCKS_A_SIDE), bool)
    entries = tiles.entries[numbers(tiles)]
    bits = np.unpackbits(entries[:, :2].copy().view(np.uint8), axis=1, bitorder="little").astype(bool)
    for blocks, (gaussian, tile) in zip(bits, entries[:, 2:], strict=True):
        assert blocks.any()
        row, column = (BLOCKS_A_SIDE * k for k in divmod(tile, tiles.tiles_x))
        part = touched[gaussian, row : row + BLOCKS_A_SIDE, column : column + BLOCKS_A_SIDE]
        assert not part.any()
        part[:] = blocks.reshape(BLOCKS_A_SIDE, BLOCKS_A_SIDE)
    return touched


def least_in_boxes(record: np.ndarray, x: tuple, y: tuple) -> np.ndarray:
    """(n, h, w): the least e^2 + f^2 of n records in the boxes between x (2, w) and y (2, h)."""
    u, v, a, b, c = (record[:, k, None, None] for k in (U, V, FACTOR_A, FACTOR_B, FACTOR_C))
    (left, right), (top, bottom) = (edges - u for edges in x), (edges[:, None] - v for edges in y)

    def form(dx: np.ndarray, dy: np.ndarray) -> np.ndarray:
        return (a * dx + b * dy) ** 2 + (c * dy) ** 2

    inside = (left <= 0) & (right >= 0) & (top <= 0) & (bottom >= 0)
    across = [form(np.clip(-b * dy / a, left, right), dy) for dy in (top, bottom)]
    down = [form(dx, np.clip(-a * b * dx / (b * b + c * c), top, bottom)) for dx in (left, right)]
    return np.where(inside, 0.0, np.minimum.reduce([*across, *down]))


@settings(max_examples=100, deadline=None, derandomize=True)
@given(scenes())
def test_the_blocks_are_exactly_those_that_the_ellipse_touches(scene: tuple[SplatAsset, Camera]) -> None:
    asset, camera = scene
    tiles = entries_of(asset, camera)
    touched = touched_blocks(tiles, len(asset))
    drawn = touched.any(axis=(1, 2))
    record = tiles.records[: len(asset)][drawn].astype(np.float64)
    touched, level = touched[drawn], (record[:, EIGHTH] - EIGHTH_SMALLEST)[:, None, None]

    rows, columns = touched.shape[1:]
    x, y = np.arange(BLOCK_PX * columns) + 0.5, np.arange(BLOCK_PX * rows) + 0.5
    at_pixels = least_in_boxes(record, (x, x), (y, y))
    at_pixels[:, camera.height :] = at_pixels[:, :, camera.width :] = np.inf
    # A shift of the level by 1e-4 is one of alpha by 6e-4 of itself.
    counts = (at_pixels < level - 1e-4).reshape(-1, rows, BLOCK_PX, columns, BLOCK_PX).any(axis=(2, 4))
    assert not (counts & ~touched).any()

    def sides(centres: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return centres[::BLOCK_PX] - HELD_OUT_PX, centres[BLOCK_PX - 1 :: BLOCK_PX] + HELD_OUT_PX

    near = least_in_boxes(record, sides(x), sides(y)) <= level + 1e-4
    assert not (touched & ~near).any()
    beyond = -(-camera.height // BLOCK_PX), -(-camera.width // BLOCK_PX)
    assert not touched[:, beyond[0] :].any() and not touched[:, :, beyond[1] :].any()


@settings(max_examples=60, deadline=None, derandomize=True)
@given(scenes())
def test_no_visible_gaussian_is_left_out(scene: tuple[SplatAsset, Camera]) -> None:
    """Those without an entry show in no pixel of the reference either."""
    asset, camera = scene
    tiles = entries_of(asset, camera)
    without = np.setdiff1d(np.arange(len(asset)), tiles.entries[numbers(tiles), 2])
    hidden = asset.subset(PackedGaussians.of(asset).order[without])
    with np.errstate(all="ignore"):
        _, alpha, _ = (a.detach().numpy() for a in rasterize(*parameters(hidden), camera))
    assert (alpha < 1.001 / 255.0).all()


def assert_sorted(tiles: TileEntries) -> None:
    entries, depth_bits = tiles.entries[numbers(tiles)], tiles.order >> np.uint64(32)
    tile_of_place = np.repeat(np.arange(len(tiles.starts) - 1), np.diff(tiles.starts))
    np.testing.assert_array_equal(entries[:, 3], tile_of_place)
    depths = tiles.records[entries[:, 2], DEPTH]
    np.testing.assert_array_equal(depth_bits, depths.view(np.uint32))
    expected = np.lexsort((entries[:, 2], depths, tile_of_place))
    np.testing.assert_array_equal(expected, np.arange(len(entries)))


@settings(max_examples=40, deadline=None, derandomize=True)
@given(scenes(largest_px=150))
def test_the_nearest_comes_first_in_each_tile(scene: tuple[SplatAsset, Camera]) -> None:
    assert_sorted(entries_of(*scene))


@pytest.mark.parametrize("levels", [1, 3, 1000])
def test_equal_depths_keep_the_order_of_numbers_over_all_segments(levels: int) -> None:
    rng, count = np.random.default_rng(levels), 20_000
    camera = Camera(200, 140, 150.0, 150.0, 100.0, 70.0, np.eye(4))
    means = rng.uniform([-0.8, -0.6, 0.0], [0.8, 0.6, 0.0], (count, 3))
    means[:, 2] = 1.0 + rng.integers(levels, size=count) / levels
    asset = SplatAsset(
        means=means,
        log_scales=np.full((count, 3), -5.0),
        quaternions=np.ones((count, 4)),
        logit_opacities=rng.normal(size=count),
        sh=np.zeros((count, 1, 3)),
    )
    tiles = entries_of(asset, camera)
    assert len(tiles.order) > count // 2
    assert_sorted(tiles)


def everywhere(count: int) -> SplatAsset:
    """Faint Gaussians far larger than the view."""
    rng = np.random.default_rng(0)
    return SplatAsset(
        means=rng.uniform([-0.5, -0.5, 2.0], [0.5, 0.5, 4.0], (count, 3)),
        log_scales=np.full((count, 3), 4.0),
        quaternions=rng.normal(size=(count, 4)),
        logit_opacities=np.full(count, -3.0),
        sh=rng.normal(size=(count, 1, 3)),
    )


def test_a_gaussian_can_cover_every_block() -> None:
    camera = Camera(101, 67, 80.0, 80.0, 50.0, 33.0, np.eye(4))
    touched = touched_blocks(entries_of(everywhere(5), camera), 5)
    assert touched[:, : -(-67 // BLOCK_PX), : -(-101 // BLOCK_PX)].all()


def test_more_entries_than_room_give_the_same_image() -> None:
    camera, rasterizer = Camera(203, 150, 150.0, 150.0, 100.0, 75.0, np.eye(4)), Rasterizer()
    few, many = random_asset(np.random.default_rng(0), 7), everywhere(40)
    rasterizer.forward(PackedGaussians.of(few), camera)
    room = len(rasterizer.tile_entries.entries)
    packed = PackedGaussians.of(many)
    rasterizer.forward(packed, camera)
    tiles = rasterizer.tile_entries
    assert len(tiles.order) == 40 * len(tiles.starts[1:]) > room
    assert len(tiles.entries) > room
    assert_sorted(tiles)
    grown = rasterizer.colour.copy()
    expected = rasterize(*(leaf.detach() for leaf in parameters(many)), camera)[0].numpy()
    np.testing.assert_allclose(grown, expected, atol=2e-5)
    rasterizer.forward(packed, camera)  # with room enough from the start
    np.testing.assert_array_equal(rasterizer.colour, grown)
    assert len(rasterizer.tile_entries.entries) == len(tiles.entries)


@pytest.mark.parametrize(("width", "height"), [(1, 1), (4, 3), (5, 33), (32, 32), (33, 64), (65, 31)])
def test_images_of_any_size_equal_the_reference(width: int, height: int) -> None:
    asset, camera = random_asset(np.random.default_rng(1)), small_camera(width, height)
    rasterizer = Rasterizer()
    rasterizer.forward(PackedGaussians.of(asset), camera)
    assert len(rasterizer.tile_entries.starts) == -(-width // TILE_PX) * -(-height // TILE_PX) + 1
    expected = rasterize(*(leaf.detach() for leaf in parameters(asset)), camera)[0].numpy()
    np.testing.assert_allclose(rasterizer.colour, expected, atol=1e-5)

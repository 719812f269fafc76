"""What a camera sees of an asset beside its colour: normals, which Gaussian, which instance.

The maps follow the rasteriser's own blending: a Gaussian counts in a pixel where its alpha
is at least 1/255 and what stands in front of it has not used the light up, and its weight
there is alpha times the transmittance in front of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from ...core.cameras import Camera
from ...core.errors import AssetError
from ..asset import SplatAsset
from ..kernels.blending import FINISHED
from ..kernels.compiled import kernel, parallel_kernel, prange
from ..kernels.packing import PackedGaussians
from ..kernels.projection import EIGHTH, EIGHTH_SMALLEST, FACTOR_A, FACTOR_B, FACTOR_C, LARGEST_ALPHA, U, V
from ..kernels.tiles import BLOCK_PX, BLOCKS, BLOCKS_A_SIDE, TILE_PX
from ..quaternions import to_rotation
from ..vector_language.exponentials import EXP2_COEFFICIENTS_BELOW_0
from ..vector_language.vectors import LANES
from .rasterizer import SMALLEST_ALPHA, Background, Rasterizer, Rendering, TileEntries

NONE = -1
"""Number of the Gaussian, and of the instance, where nothing is seen."""

_C5, _C4, _C3, _C2, _C1, _C0 = map(np.float32, EXP2_COEFFICIENTS_BELOW_0)
_SMALLEST_EXPONENT, _LARGEST_ALPHA = np.float32(EIGHTH_SMALLEST), np.float32(LARGEST_ALPHA)
_FINISHED = np.float32(FINISHED)
_NO_WEIGHT = np.float32(0.0)
_MIDDLE = np.float32(TILE_PX / 2 - 0.5)
_COLUMNS, _ROWS = (axis(np.arange(LANES), BLOCK_PX).astype(np.float32) for axis in (np.mod, np.floor_divide))

_SHORTEST_SUM = 1e-6
"""Normals whose weighted sum is shorter than this cancel out and leave no direction."""


@dataclass(frozen=True)
class Outputs(Rendering):
    """A rendering with what else is known of each pixel and each Gaussian.

    ``normals`` (H, W, 3) float32 are unit vectors in the world frame, the mean of the
    Gaussians' own by weight: each one's is its shortest axis, turned to the camera; 0 where
    nothing is. ``gaussian`` (H, W) int32 is the number of the Gaussian with the greatest
    weight, ``instance`` (H, W) int32 the instance whose Gaussians' weights have the greatest
    sum, the smaller number of equal ones; both are -1 where nothing is. ``visibility`` (N,)
    int32 counts the pixels in which each Gaussian counts.
    """

    normals: np.ndarray
    gaussian: np.ndarray
    instance: np.ndarray
    visibility: np.ndarray


def render_outputs(
    asset: SplatAsset, camera: Camera, instances: np.ndarray | None = None, background: Background = (0.0, 0.0, 0.0)
) -> Outputs:
    """What ``camera`` sees of ``asset``.

    ``instances`` (N,) int32, if given, are the Gaussians' instances, -1 for those of none;
    without them ``Outputs.instance`` is -1 everywhere. Raises AssetError when there is not
    one for each Gaussian.
    """
    if instances is not None and np.shape(instances) != (len(asset),):
        raise AssetError(
            f"instances has the shape {np.shape(instances)}, not {(len(asset),)}",
            cure="Give one number for each Gaussian.",
        )
    packed, rasterizer = PackedGaussians.of(asset), Rasterizer()
    rasterizer.forward(packed, camera, background)
    rendering = rasterizer.rendering()
    rasterizer.forward(packed, camera, with_depth=False, colours=facing_normals(asset, camera))
    gaussian, instance, visibility = _identify(rasterizer.tile_entries, packed, camera, instances)
    return Outputs(
        colour=rendering.colour,
        alpha=rendering.alpha,
        depth=rendering.depth,
        normals=_directions(rasterizer.colour, rendering.alpha),
        gaussian=gaussian,
        instance=instance,
        visibility=visibility,
    )


def render_batch(
    asset: SplatAsset, cameras: Iterable[Camera], background: Background = (0.0, 0.0, 0.0)
) -> Iterator[Rendering]:
    """Each camera's rendering, in order and one at a time; sizes and lenses may differ."""
    packed, rasterizer = PackedGaussians.of(asset), Rasterizer()
    for camera in cameras:
        rasterizer.forward(packed, camera, background)
        yield rasterizer.rendering()


def facing_normals(asset: SplatAsset, camera: Camera) -> np.ndarray:
    """(N, 3) float32: each Gaussian's shortest axis in the world, turned to the camera."""
    quaternions = asset.quaternions.astype(np.float64)
    sound = np.isfinite(quaternions).all(axis=1) & quaternions.any(axis=1)
    quaternions[~sound] = 1.0, 0.0, 0.0, 0.0
    shortest = np.argmin(asset.log_scales, axis=1)[:, None, None]
    normals = np.take_along_axis(to_rotation(quaternions), shortest, axis=2)[..., 0]
    away = ((asset.means - camera.centre) * normals).sum(axis=1) > 0.0
    return np.where(away[:, None], -normals, normals).astype(np.float32)


def _directions(sums: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """(H, W, 3) the sums of weight * normal as unit vectors, 0 where there is none."""
    length = np.linalg.norm(sums, axis=-1)
    known = (alpha > SMALLEST_ALPHA) & (length > _SHORTEST_SUM)
    return np.where(known[..., None], sums / np.where(known, length, 1.0)[..., None], np.float32(0.0))


def pixel_counts(tiles: TileEntries, shape: tuple[int, int]) -> np.ndarray:
    """(16 chunks,) int64: in how many pixels of an image of ``shape`` each packed place counts."""
    _, _, pixels = _identify_places(tiles, shape, np.zeros(0, np.int32))
    return pixels


def _identify(
    tiles: TileEntries, packed: PackedGaussians, camera: Camera, instances: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The maps of Gaussians and instances, and the Gaussians' numbers of pixels."""
    labels = np.zeros(0, np.int32) if instances is None else np.asarray(instances, np.int32)[packed.order]
    place, instance, pixels = _identify_places(tiles, camera.shape, labels)
    visibility = np.zeros(len(packed), np.int32)
    visibility[packed.order] = pixels[: len(packed)]
    numbers = np.append(packed.order, NONE).astype(np.int32)  # its last is that of place -1
    return numbers[place], instance, visibility


def _identify_places(
    tiles: TileEntries, shape: tuple[int, int], labels: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The maps (H, W) of packed places and of their labels, and the places' numbers of pixels."""
    place, label = np.full((2, *shape), NONE, np.int32)
    pixels = np.zeros(len(tiles.order), np.int32)
    entries = tiles.entries[tiles.order & np.uint64(0xFFFFFFFF)]
    places, blocks = np.ascontiguousarray(entries[:, 2]), entries[:, :2].copy().view(np.int64)[:, 0]
    _identify_tiles(tiles.records, places, blocks, tiles.starts, tiles.tiles_x, labels, place, label, pixels)
    counts = np.bincount(places, weights=pixels, minlength=len(tiles.records)).astype(np.int64)
    return place, label, counts


@kernel
def block_weights(record, left, top, columns, rows, transmittance, weights):
    """Fill a block's ``weights`` (16,) of a Gaussian; returns in how many pixels it counts.

    ``left`` and ``top`` are the distance of the block's first pixel from the Gaussian's
    centre, ``columns`` and ``rows`` (16,) the lanes' pixels from that one. The lanes' loop
    has no branch, so that it becomes vector code.
    """
    a, b, c, eighth = record[FACTOR_A], record[FACTOR_B], record[FACTOR_C], record[EIGHTH]
    count = 0
    for lane in range(LANES):
        dy = top + rows[lane]
        e, f = a * (left + columns[lane]) + b * dy, c * dy
        exponent = eighth - e * e - f * f
        power = (((_C5 * exponent + _C4) * exponent + _C3) * exponent + _C2) * exponent * exponent
        power += _C1 * exponent + _C0
        power *= power
        power *= power
        alpha = min(power * power, _LARGEST_ALPHA)
        counts = (exponent >= _SMALLEST_EXPONENT) & (transmittance[lane] > _FINISHED)
        weight = alpha * transmittance[lane] if counts else _NO_WEIGHT
        weights[lane] = weight
        transmittance[lane] -= weight
        count += counts
    return count


@parallel_kernel
def _identify_tiles(records, places, blocks, starts, tiles_x, labels, place_map, label_map, pixels):
    """Fill ``place_map`` and ``label_map`` (H, W), and ``pixels`` (E,) of the entries in order.

    ``places`` and ``blocks`` (E,) are the entries' Gaussians and blocks. ``labels`` are those
    of the packed Gaussians; if it is empty, ``label_map`` stays as it is.
    """
    height, width = place_map.shape
    for tile in prange(len(starts) - 1):
        start, stop = starts[tile], starts[tile + 1]
        tile_x, tile_y = tile % tiles_x * TILE_PX, tile // tiles_x * TILE_PX
        present, ranks = np.empty(0, np.int32), np.empty(0, np.int64)
        if len(labels) > 0 and stop > start:
            own = labels[places[start:stop]]
            present = np.unique(own)
            ranks = np.searchsorted(present, own)
        sums = np.empty((len(present), LANES), np.float32)
        transmittance, weights = np.empty(LANES, np.float32), np.empty(LANES, np.float32)
        best, winner = np.empty(LANES, np.float32), np.empty(LANES, np.int32)
        for block in range(BLOCKS):
            x, y = block % BLOCKS_A_SIDE * BLOCK_PX, block // BLOCKS_A_SIDE * BLOCK_PX
            best[:] = 0.0
            winner[:] = NONE
            sums[:] = 0.0
            for lane in range(LANES):
                column, row = tile_x + x + lane % BLOCK_PX, tile_y + y + lane // BLOCK_PX
                transmittance[lane] = 1.0 if column < width and row < height else 0.0
            for k in range(start, stop):
                if blocks[k] >> block & 1:
                    record = records[places[k]]
                    # From the tile's middle: far from the image's corner digits would be lost.
                    left = np.float32(x) - _MIDDLE - (record[U] - np.float32(tile_x + TILE_PX // 2))
                    top = np.float32(y) - _MIDDLE - (record[V] - np.float32(tile_y + TILE_PX // 2))
                    pixels[k] += block_weights(record, left, top, _COLUMNS, _ROWS, transmittance, weights)
                    place, light = places[k], np.float32(0.0)
                    for lane in range(LANES):
                        better = weights[lane] > best[lane]
                        best[lane] = weights[lane] if better else best[lane]
                        winner[lane] = place if better else winner[lane]
                        light = max(light, transmittance[lane])
                    if len(present) > 0:
                        total = sums[ranks[k - start]]
                        for lane in range(LANES):
                            total[lane] += weights[lane]
                    if light <= _FINISHED:
                        break
            for lane in range(LANES):
                column, row = tile_x + x + lane % BLOCK_PX, tile_y + y + lane // BLOCK_PX
                if column < width and row < height:
                    place_map[row, column] = winner[lane]
                    if len(present) > 0 and winner[lane] != NONE:
                        label_map[row, column] = present[np.argmax(sums[:, lane])]

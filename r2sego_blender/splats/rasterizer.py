"""Rendering of a splat asset at any camera, and the gradient of it."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..cameras import Camera
from ..errors import AssetError
from .asset import SplatAsset
from .binning import (
    SEGMENTS,
    TILE_HEIGHT_PX,
    TILE_WIDTH_PX,
    count_entries,
    place_entries,
    scatter_entries,
    sort_by_depth,
)
from .compositing import composite, composite_backward
from .projection import MOMENT_COLUMNS, SCREEN_COLUMNS, lens_of, project, project_backward

_SPARE = 1.25
"""Arrays that must grow get this much more than is needed now."""

Background = Sequence[float] | np.ndarray
"""What is seen where the Gaussians let light through: one colour, or an image (H, W, 3)."""

SMALLEST_ALPHA = 1e-6
"""Where alpha is not above this, nothing was seen and depth is 0."""


@dataclass(frozen=True)
class Rendering:
    """What a camera sees of an asset: float32 arrays of the camera's size.

    ``colour`` (H, W, 3) over the background, not clipped above 1; ``alpha`` (H, W) in
    [0, 1]; ``depth`` (H, W) expected planar depth in metres, normalised by alpha, 0 where
    nothing is.
    """

    colour: np.ndarray
    alpha: np.ndarray
    depth: np.ndarray


@dataclass
class Gradients:
    """The loss' gradients in the parameters of an asset, of the same shapes.

    Rows of Gaussians that are not ``touched`` (N,) hold no meaning.
    """

    means: np.ndarray
    log_scales: np.ndarray
    quaternions: np.ndarray
    logit_opacities: np.ndarray
    sh: np.ndarray
    touched: np.ndarray

    @staticmethod
    def of(asset: SplatAsset) -> Gradients:
        """Zeros, with no Gaussian touched."""
        return Gradients(
            np.zeros_like(asset.means),
            np.zeros_like(asset.log_scales),
            np.zeros_like(asset.quaternions),
            np.zeros_like(asset.logit_opacities),
            np.zeros_like(asset.sh),
            np.zeros(len(asset), bool),
        )


class Rasterizer:
    """The rasteriser's buffers, kept from image to image; not for two threads at once.

    ``forward`` leaves ``colour`` (H, W, 3), ``transmittance`` (H, W) and ``depth_sum``
    (H, W), the sum of weight * depth, which the next ``forward`` overwrites; ``backward``
    belongs to the last ``forward``.
    """

    def __init__(self) -> None:
        self._capacity = -1
        self._shape = (0, 0)
        self._entries = np.empty((0, 4), np.int32)
        self._slots = np.empty((0, MOMENT_COLUMNS), np.float32)

    def forward(
        self,
        asset: SplatAsset,
        camera: Camera,
        background: Background = (0.0, 0.0, 0.0),
        degree: int | None = None,
    ) -> None:
        """Render ``asset``, with harmonics up to ``degree`` (default: all it has)."""
        self._reserve(len(asset), camera.shape)
        n = len(asset)
        self._asset, self._lens = asset, lens_of(camera)
        self._coefficients = asset.sh.shape[1] if degree is None else (min(degree, asset.degree) + 1) ** 2
        self._screen, self._visible = self._all_screen[:n], self._all_visible[:n]
        project(
            asset.means, asset.log_scales, asset.quaternions, asset.logit_opacities, asset.sh,
            self._coefficients, self._lens, self._screen, self._visible,
        )  # fmt: skip
        order, spare, ranks = (array[:n] for array in (self._order, self._spare_order, self._ranks))
        count = sort_by_depth(
            self._visible, self._screen, order, spare, self._keys[:n], self._spare_keys[:n], ranks
        )
        count_entries(
            order,
            count,
            self._screen,
            self._tiles_x,
            camera.height,
            self._sorted,
            self._counts,
            self._histogram,
        )
        total = place_entries(self._counts, count, self._histogram, self._offsets, self._tile_starts)
        if total > len(self._entries):
            self._entries = np.empty((int(total * _SPARE), 4), np.int32)
        scatter_entries(
            self._sorted, count, self._tiles_x, camera.height, self._offsets, self._histogram, self._entries
        )
        composite(
            self._sorted, self._entries, self._tile_starts, self._tiles_x, _image_of(background, camera),
            self.colour, self.transmittance, self.depth_sum, self._tile_stops,
        )  # fmt: skip

    def rendering(self) -> Rendering:
        """The last ``forward``'s result, in arrays of its own."""
        alpha = 1.0 - self.transmittance
        depth = np.where(alpha > SMALLEST_ALPHA, self.depth_sum / np.maximum(alpha, SMALLEST_ALPHA), 0.0)
        return Rendering(self.colour.copy(), alpha, depth.astype(np.float32))

    def backward(
        self, g_colour: np.ndarray, g_alpha: np.ndarray, g_depth_sum: np.ndarray, gradients: Gradients
    ) -> None:
        """Write into ``gradients`` from those of colour (H, W, 3), alpha and depth_sum (H, W)."""
        if len(self._slots) < len(self._entries):
            self._slots = np.empty((len(self._entries), MOMENT_COLUMNS), np.float32)
        composite_backward(
            self._sorted, self._entries, self._tile_starts, self._tile_stops, self._tiles_x,
            self.colour, self.transmittance, self.depth_sum, g_colour, g_alpha, g_depth_sum, self._slots,
        )  # fmt: skip
        asset = self._asset
        project_backward(
            self._ranks[: len(asset)], self._offsets, self._counts, self._slots,
            asset.means, asset.log_scales, asset.quaternions, asset.logit_opacities, asset.sh,
            self._coefficients, self._lens, self._screen,
            gradients.means, gradients.log_scales, gradients.quaternions, gradients.logit_opacities,
            gradients.sh, gradients.touched,
        )  # fmt: skip

    def _reserve(self, gaussians: int, shape: tuple[int, int]) -> None:
        if gaussians > self._capacity:
            self._capacity = gaussians
            self._all_screen = np.empty((gaussians, SCREEN_COLUMNS), np.float32)
            self._all_visible = np.empty(gaussians, bool)
            self._sorted = np.empty((gaussians, SCREEN_COLUMNS), np.float32)
            self._order, self._spare_order, self._ranks, self._counts = np.empty((4, gaussians), np.int32)
            self._keys, self._spare_keys = np.empty((2, gaussians), np.uint32)
            self._offsets = np.empty(gaussians, np.int64)
        if shape != self._shape:
            self._shape = shape
            height, width = shape
            self._tiles_x = -(-width // TILE_WIDTH_PX)
            tiles = self._tiles_x * -(-height // TILE_HEIGHT_PX)
            self._histogram = np.empty((SEGMENTS, tiles), np.int32)
            self._tile_starts = np.empty(tiles + 1, np.int64)
            self._tile_stops = np.empty(tiles, np.int64)
            self.colour = np.empty((height, width, 3), np.float32)
            self.transmittance = np.empty((height, width), np.float32)
            self.depth_sum = np.empty((height, width), np.float32)


_LOCAL = threading.local()


def _image_of(background: Background, camera: Camera) -> np.ndarray:
    """(H, W, 3) or, of one colour, (1, 1, 3), float32."""
    image = np.ascontiguousarray(background, np.float32)
    image = image[None, None] if image.ndim == 1 else image
    if image.shape not in ((1, 1, 3), (*camera.shape, 3)):
        raise AssetError(
            f"the background has the shape {image.shape}, the camera {camera.shape}",
            cure="Give one colour or an image of the camera's size.",
        )
    return image


def render(asset: SplatAsset, camera: Camera, background: Background = (0.0, 0.0, 0.0)) -> Rendering:
    """What ``camera`` sees of ``asset`` over ``background``; buffers are kept between calls."""
    if not hasattr(_LOCAL, "rasterizer"):
        _LOCAL.rasterizer = Rasterizer()
    rasterizer = _LOCAL.rasterizer
    rasterizer.forward(asset, camera, background)
    return rasterizer.rendering()

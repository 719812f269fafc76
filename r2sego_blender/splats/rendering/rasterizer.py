"""Rendering of a splat asset at any camera, and the gradient of it."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np

from ...core.cameras import Camera
from ...core.errors import AssetError
from ..asset import SplatAsset
from ..kernels.adam import AdamState
from ..kernels.batches import SLOT_BYTES
from ..kernels.binning import ENTRY_BYTES, SEGMENTS, append_entries, sort_entries
from ..kernels.blending import TABLE
from ..kernels.compositing import SCRATCH_BYTES, composite, composite_backward
from ..kernels.packing import PackedGaussians, unpack
from ..kernels.projection import DILATION_PX2, RECORD_BYTES, RED, lens_of, project
from ..kernels.projection_gradient import GATHER_BYTES, POSE_SUMS, project_backward, project_backward_adam
from ..kernels.tiles import DEPTH_PLANE, IMAGE_PLANES, TILE_PX, TRANSMITTANCE_PLANE, planes_of
from ..vector_language.aligned_memory import aligned, aligned_copy
from ..vector_language.vectors import LANES, VECTOR_BYTES

_SPARE = 1.25
"""Arrays that must grow get this much more than is needed now."""

_MOST_SIZES = 8
"""Buffers of this many image sizes are kept, the ones used last."""

Background = Sequence[float] | np.ndarray
"""What is seen where the Gaussians let light through: one colour (3,), an image (H, W, 3),
or the image's planes (3, H', W') as ``planes_of`` makes them."""

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

    They are 0 for Gaussians that took no part in the image. ``pose`` (6,) float64 is that of
    the camera: of a small rotation and translation of its frame, camera_from_world becoming
    exp(w, t) camera_from_world.
    """

    means: np.ndarray
    log_scales: np.ndarray
    quaternions: np.ndarray
    logit_opacities: np.ndarray
    sh: np.ndarray
    pose: np.ndarray


@dataclass(frozen=True)
class TileEntries:
    """Which Gaussians touch which tile, the nearest first; arrays of the rasteriser's own.

    Tile t, row by row with ``tiles_x`` in a row, has the places ``starts[t]`` to before
    ``starts[t + 1]`` of ``order`` (E,) uint64. The low half of each is a row of ``entries``
    (., 4) int32: 64 bits for the blocks (see ``binning``), the packed Gaussian's place, and
    the tile. ``records`` (16 chunks, 16) float32 are the projected Gaussians.
    """

    records: np.ndarray
    entries: np.ndarray
    order: np.ndarray
    starts: np.ndarray
    tiles_x: int


@dataclass
class _Frame:
    """What depends on the image's size: the tiles' lists, and image planes of whole tiles."""

    tiles_x: int
    histogram: np.ndarray
    tile_starts: np.ndarray
    tile_stops: np.ndarray
    planes: np.ndarray
    gradient_planes: np.ndarray

    @property
    def plane_bytes(self) -> int:
        return self.planes[0].nbytes

    @staticmethod
    def of(shape: tuple[int, int]) -> _Frame:
        tiles_y, tiles_x = (-(-side // TILE_PX) for side in shape)
        size, tiles = (tiles_y * TILE_PX, tiles_x * TILE_PX), tiles_x * tiles_y
        return _Frame(
            tiles_x=tiles_x,
            histogram=np.empty((SEGMENTS, tiles), np.int32),
            tile_starts=np.zeros(tiles + 1, np.int64),
            tile_stops=np.zeros(tiles, np.int64),
            planes=aligned((IMAGE_PLANES, *size)),
            gradient_planes=aligned((IMAGE_PLANES, *size)),
        )


class Rasterizer:
    """The rasteriser's buffers, kept from image to image; not for two threads at once.

    ``forward`` fills image planes that stay valid until the next ``forward``; ``backward``
    and ``step`` belong to the last ``forward``.
    """

    def __init__(self) -> None:
        self._chunks, self._capacity = -1, 0
        self._shape = (0, 0)
        self._frames: dict[tuple[int, int], _Frame] = {}
        self._slots = aligned((0, SLOT_BYTES // 4))
        threads = numba.config.NUMBA_NUM_THREADS
        self._scratch = aligned((threads, max(SCRATCH_BYTES, GATHER_BYTES)), np.uint8)
        self._lens = aligned(32)
        self._one_colour = aligned((3, LANES))

    def forward(
        self,
        gaussians: PackedGaussians,
        camera: Camera,
        background: Background = (0.0, 0.0, 0.0),
        degree: int = 3,
        with_depth: bool = True,
        colours: np.ndarray | None = None,
        dilation_px2: float = DILATION_PX2,
    ) -> None:
        """Render, with harmonics up to ``degree`` or as many as there are.

        ``dilation_px2`` is added to the variances on the screen. ``colours`` (N, 3), in the
        asset's order, of any finite value, stand in for the Gaussians' own; the gradient of
        such an image is not to be asked for.
        """
        self._reserve(len(gaussians.values), camera.shape)
        self._gaussians, self._camera, self._with_depth = gaussians, camera, with_depth
        self._degree = min(degree, round(gaussians.coefficients**0.5) - 1)
        lens = lens_of(camera, dilation_px2)
        self._lens[: len(lens)] = lens
        values, visible = gaussians.values, self._visible[: len(gaussians.values)]
        project(
            values.ctypes.data,
            len(values),
            values.strides[0],
            self._degree,
            self._lens.ctypes.data,
            self._records.ctypes.data,
            visible,
            numba.get_num_threads(),
        )
        if colours is not None:
            self._records[: len(gaussians), RED : RED + 3] = colours[gaussians.order]
        self._append_entries(visible)
        frame = self._frame
        sort_entries(
            self._entry_words,
            self._capacity,
            self._totals,
            self._record_bits,
            frame.histogram,
            frame.tile_starts,
            self._order,
            self._spare_order,
            numba.get_num_threads(),
        )
        behind, strides = self._behind(background)
        composite(
            *self._sorted_entries(),
            frame.planes.ctypes.data,
            frame.plane_bytes,
            behind.ctypes.data,
            *strides,
            self._scratch.ctypes.data,
            TABLE.ctypes.data,
            with_depth,
            numba.get_num_threads(),
        )

    @property
    def planes(self) -> np.ndarray:
        """(5, H', W') float32: red, green, blue, transmittance, sum of weight * depth.

        H' and W' are whole tiles; what lies outside the camera's image means nothing. The
        depth is there if the last ``forward`` had it.
        """
        return self._frame.planes

    @property
    def gradient_planes(self) -> np.ndarray:
        """(5, H', W') float32, for ``backward`` to read: the loss' gradients in colour, alpha
        and the depth sum. Outside the camera's image they must be 0."""
        return self._frame.gradient_planes

    @property
    def colour(self) -> np.ndarray:
        """(H, W, 3) float32, a view."""
        height, width = self._camera.shape
        return self._frame.planes[:3, :height, :width].transpose(1, 2, 0)

    @property
    def transmittance(self) -> np.ndarray:
        """(H, W) float32, a view."""
        height, width = self._camera.shape
        return self._frame.planes[TRANSMITTANCE_PLANE, :height, :width]

    @property
    def depth_sum(self) -> np.ndarray:
        """(H, W) float32, a view: the sum of weight * depth."""
        height, width = self._camera.shape
        return self._frame.planes[DEPTH_PLANE, :height, :width]

    @property
    def tile_entries(self) -> TileEntries:
        """The last ``forward``'s, valid until the next."""
        starts = self._frame.tile_starts
        order = self._order[: starts[-1]]
        return TileEntries(self._records, self._entry_words, order, starts, self._frame.tiles_x)

    def rendering(self) -> Rendering:
        """The last ``forward``'s result, in arrays of its own."""
        alpha = 1.0 - self.transmittance
        depth = np.where(alpha > SMALLEST_ALPHA, self.depth_sum / np.maximum(alpha, SMALLEST_ALPHA), 0.0)
        return Rendering(np.ascontiguousarray(self.colour), alpha, depth.astype(np.float32))

    def backward(
        self, g_colour: np.ndarray, g_alpha: np.ndarray | None = None, g_depth_sum: np.ndarray | None = None
    ) -> Gradients:
        """The gradients from those of colour (H, W, 3), and of alpha and depth_sum (H, W)."""
        height, width = self._camera.shape
        self._frame.gradient_planes[:, :height, :width] = 0.0
        self._frame.gradient_planes[:3, :height, :width] = np.moveaxis(g_colour, 2, 0)
        for plane, gradient in ((TRANSMITTANCE_PLANE, g_alpha), (DEPTH_PLANE, g_depth_sum)):
            if gradient is not None:
                self._frame.gradient_planes[plane, :height, :width] = gradient
        self._composite_backward(g_alpha is not None, g_depth_sum is not None)
        gradients = aligned(self._gaussians.values.shape)
        project_backward(
            *self._backward_arguments(), gradients.ctypes.data, self._pose_rows.ctypes.data, numba.get_num_threads()
        )
        columns = np.empty((len(self._gaussians), gradients.shape[1]), np.float32)
        columns[self._gaussians.order] = unpack(gradients, len(self._gaussians))
        return Gradients(
            columns[:, :3],
            columns[:, 3:6],
            columns[:, 6:10],
            columns[:, 10],
            columns[:, 11:].reshape(len(columns), self._gaussians.coefficients, 3),
            self.pose_gradient(),
        )

    def step(
        self,
        state: AdamState,
        rates: np.ndarray,
        opacity_pull: float = 0.0,
        scale_pull: float = 0.0,
        with_alpha: bool = False,
        with_depth: bool = False,
    ) -> None:
        """Move the Gaussians by one step of Adam along ``gradient_planes``.

        ``rates`` (rows,) float32 are the learning rates of the packed rows; the pulls are the
        gradients of each blended Gaussian's opacity and scales (1/m) in the loss.
        """
        self._composite_backward(with_alpha, with_depth)
        rates = np.ascontiguousarray(rates, np.float32)
        project_backward_adam(
            *self._backward_arguments(),
            state.first.ctypes.data,
            state.second.ctypes.data,
            state.steps.ctypes.data,
            state.statistics.ctypes.data,
            rates.ctypes.data,
            np.float32(opacity_pull),
            np.float32(scale_pull),
            self._pose_rows.ctypes.data,
            numba.get_num_threads(),
        )

    def pose_gradient(self) -> np.ndarray:
        """(6,) float64, as in ``Gradients``: of the last ``backward`` or ``step``."""
        rows = self._pose_rows[: len(self._gaussians.values), :POSE_SUMS]
        return rows.sum(axis=0, dtype=np.float64)

    def _append_entries(self, visible: np.ndarray) -> None:
        height, width = self._camera.shape
        while True:
            append_entries(
                self._records.ctypes.data,
                visible,
                width,
                height,
                self._entries.ctypes.data,
                self._capacity,
                self._starts,
                self._counts,
                self._totals,
            )
            needed = int(self._totals.max(initial=0))
            if needed < self._capacity:
                return
            self._reserve_entries(int(needed * _SPARE) + LANES)

    def _composite_backward(self, with_alpha: bool, with_depth: bool) -> None:
        if with_depth and not self._with_depth:
            raise ValueError("the image was rendered without depth")
        if len(self._slots) < len(self._entries):
            self._slots = aligned((len(self._entries), SLOT_BYTES // 4))
        frame = self._frame
        composite_backward(
            *self._sorted_entries(),
            frame.planes.ctypes.data,
            frame.gradient_planes.ctypes.data,
            frame.plane_bytes,
            self._slots.ctypes.data,
            self._scratch.ctypes.data,
            TABLE.ctypes.data,
            with_alpha,
            with_depth,
            numba.get_num_threads(),
        )

    def _sorted_entries(self) -> tuple[int, int, int, np.ndarray, np.ndarray, int]:
        return (
            self._records.ctypes.data,
            self._entries.ctypes.data,
            self._order.ctypes.data,
            self._frame.tile_starts,
            self._frame.tile_stops,
            self._frame.tiles_x,
        )

    def _backward_arguments(self) -> tuple[int, int, int, int, int, np.ndarray, np.ndarray, np.ndarray, int, int]:
        values = self._gaussians.values
        return (
            values.ctypes.data,
            len(values),
            values.strides[0],
            self._degree,
            self._lens.ctypes.data,
            self._visible[: len(values)],
            self._starts,
            self._counts,
            self._slots.ctypes.data,
            self._scratch.ctypes.data,
        )

    def _behind(self, background: Background) -> tuple[np.ndarray, tuple[int, int, int]]:
        """The background as ``store_tile`` reads it: planes, and their strides in bytes."""
        image = np.ascontiguousarray(background, np.float32)
        if image.shape == (3,):
            self._one_colour[:] = image[:, None]
            return self._one_colour, (VECTOR_BYTES, 0, 0)
        whole_tiles = (3, *self._frame.planes.shape[1:])
        if image.shape == (*self._camera.shape, 3):
            image = planes_of(image)
        if image.shape != whole_tiles:
            raise AssetError(
                f"the background has the shape {image.shape}, the camera {self._camera.shape}",
                cure="Give one colour or an image of the camera's size.",
            )
        if image.ctypes.data % VECTOR_BYTES:  # planes from elsewhere; the kernels would end the process
            image = aligned_copy(image)
        return image, (image.strides[0], image.strides[1], VECTOR_BYTES)

    def _reserve(self, chunks: int, shape: tuple[int, int]) -> None:
        if chunks > self._chunks:
            self._chunks = chunks
            self._records = aligned((chunks * LANES, RECORD_BYTES // 4))
            self._record_bits = self._records.view(np.uint32)
            self._visible = np.zeros(chunks, np.int32)
            self._starts, self._counts = np.zeros((2, chunks * LANES), np.int32)
            self._pose_rows = aligned((chunks, LANES))
            self._totals = np.zeros(SEGMENTS, np.int64)
            self._reserve_entries(max(self._capacity, 4 * chunks * LANES // SEGMENTS + LANES))
        if shape != self._shape:
            self._shape = shape
            self._frame = self._frames.pop(shape) if shape in self._frames else _Frame.of(shape)
            self._frames[shape] = self._frame
            if len(self._frames) > _MOST_SIZES:
                self._frames.pop(next(iter(self._frames)))

    def _reserve_entries(self, capacity: int) -> None:
        self._capacity = capacity
        self._entries = aligned((SEGMENTS * capacity, ENTRY_BYTES), np.uint8)
        self._entry_words = self._entries.view(np.int32)
        self._order, self._spare_order = aligned((2, SEGMENTS * capacity), np.uint64)


_LOCAL = threading.local()


def render(asset: SplatAsset, camera: Camera, background: Background = (0.0, 0.0, 0.0)) -> Rendering:
    """What ``camera`` sees of ``asset`` over ``background``.

    Buffers, and the last asset as the kernels read it, are kept between calls: an asset's
    arrays must not be changed after it was rendered.
    """
    if not hasattr(_LOCAL, "rasterizer"):
        _LOCAL.rasterizer, _LOCAL.asset = Rasterizer(), lambda: None
    if _LOCAL.asset() is not asset:
        _LOCAL.packed, _LOCAL.asset = PackedGaussians.of(asset), weakref.ref(asset)
    rasterizer = _LOCAL.rasterizer
    rasterizer.forward(_LOCAL.packed, camera, background)
    return rasterizer.rendering()

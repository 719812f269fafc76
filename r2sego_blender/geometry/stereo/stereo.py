"""Dense stereo on the posed captures: slanted-plane PatchMatch, coarse to fine.

Stands in for the learned initial reconstruction and gives the depth the observed
geometry M_obs is made of. See ``patchmatch`` for the scheme.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from ...bundle import layout
from ...captures.capture import Capture
from ...captures.matching.neighbours import neighbours
from ...captures.per_capture import each_capture
from ...config.settings import StereoSettings
from ...core.arrays import opened_arrays, require_between, require_shapes, save_arrays
from ...core.cameras import Camera
from ...core.errors import GeometryError
from ...core.images import resize
from ...core.progress import SILENT, Progress, Task
from . import matching, patchmatch
from .consistency import support
from .noise import without_noise
from .observed_geometry import FARTHEST_M, LONGEST_UNIT

_LUMA = np.array([0.299, 0.587, 0.114], np.float32)
# Below this longest side a half-resolution image has too few windows to be worth it.
_MIN_LEVEL_SIDE_PX = 70
# Neighbouring pixels whose depths differ by more than this share are not of one segment;
# it is counted in 16 steps, and the label of no segment lies beyond those of any depth.
_SEGMENT_DIFFERENCE = 0.02
_SEGMENT_STEPS = 16
_NO_SEGMENT = 32000
_HIGHEST_COST = 1e3


@dataclass(frozen=True)
class DepthMap:
    """A capture's depth, with the evidence for it.

    ``depth`` (H, W) float32 planar metres, raw: an estimate at every pixel that could be
    matched, 0 elsewhere; ``normal`` (H, W, 3) float32 unit, world, towards the camera;
    ``cost`` (H, W) float32, 1 - NCC averaged over the best source or two; ``support`` (H, W)
    uint8, how many other captures see a surface there, 0 on speckles. ``camera`` is the
    capture's at this size. ``measured`` (H, W) bool are pixels whose depth a sensor measured, which
    nobody need confirm; None without one.
    """

    depth: np.ndarray
    normal: np.ndarray
    cost: np.ndarray
    support: np.ndarray
    camera: Camera
    measured: np.ndarray | None = None

    def reliable(self, settings: StereoSettings) -> np.ndarray:
        """(H, W) bool: matched well and seen there by another capture, be it the only one it was
        matched with, or measured by a sensor."""
        matched = (self.depth > 0.0) & (self.support >= 1) & (self.cost <= settings.max_cost)
        return matched if self.measured is None else matched | self.measured

    def save(self, path: Path) -> None:
        """Write the maps and the camera as an uncompressed ``.npz``."""
        save_arrays(
            path,
            depth=self.depth,
            normal=self.normal,
            cost=self.cost,
            support=self.support,
            **self.camera.to_arrays(),
            **({} if self.measured is None else {"measured": self.measured}),
        )

    @staticmethod
    def load(path: Path) -> DepthMap:
        """Read what ``save`` wrote. Raises GeometryError when the file is no depth map."""
        with opened_arrays(path, GeometryError, "this is not a depth map") as data:
            camera = Camera.from_arrays(data)
            maps = {name: data[name] for name in ("depth", "normal", "cost", "support")}
            size = f"{camera.height} {camera.width}"
            require_shapes(maps, depth=size, normal=f"{size} 3", cost=size, support=size)
            require_between(0.0, FARTHEST_M, depth=maps["depth"])
            require_between(-LONGEST_UNIT, LONGEST_UNIT, normal=maps["normal"])
            require_between(-1.0, _HIGHEST_COST, cost=maps["cost"])
            require_between(0, None, support=maps["support"])
            if "measured" in data:
                maps["measured"] = data["measured"]
                require_shapes(maps, measured=size)
                if maps["measured"].dtype != np.bool_ or (maps["measured"] & (maps["depth"] <= 0.0)).any():
                    raise ValueError("measured is not yes or no, or is said of no depth")
            return DepthMap(**maps, camera=camera)


def dense_stereo(
    captures: Sequence[Capture],
    depth_range_m: Sequence[tuple[float, float]],
    sparse_points: np.ndarray,
    settings: StereoSettings,
    seed: int = 0,
    progress: Progress = SILENT,
    visibility: np.ndarray | None = None,
) -> tuple[DepthMap, ...]:
    """A depth map of every capture, matched against its best neighbours.

    ``depth_range_m`` is (near, far) of each capture; ``sparse_points`` (P, 3) world, with
    ``visibility`` (P, N) bool where known, choose the neighbours. Equal for any number of
    threads. A capture that shares no point with another is matched with those it should
    meet; what no other confirms is not reliable. Raises GeometryError for fewer than two
    captures, or a depth range that is none.
    """
    _check(captures, depth_range_m)
    cameras = [capture.camera.fitted(settings.max_side_px) for capture in captures]
    pictures = [_Picture.of(capture, camera) for capture, camera in zip(captures, cameras, strict=True)]
    points = np.asarray(sparse_points, np.float64).reshape(-1, 3)
    guessed = np.concatenate([_guessed_points(c, r) for c, r in zip(cameras, depth_range_m, strict=True)])
    if len(points) == 0:
        visibility, points = None, guessed
    chosen = neighbours(cameras, points, settings.sources, visibility)
    alone = [capture.name for capture, sources in zip(captures, chosen, strict=True) if not sources]
    if alone:
        progress.message(
            f"{', '.join(alone)}: shares no measured point with another photograph; "
            "its depth is matched where the views should meet",
            "warning",
        )
        in_view = neighbours(cameras, guessed, settings.sources)
        chosen = tuple(c or g or _nearest(cameras, i) for i, (c, g) in enumerate(zip(chosen, in_view, strict=True)))

    scales = _level_scales(cameras, settings.levels)
    rounds = len(scales) * (1 + settings.geometric_rounds)
    planes: list[np.ndarray] = [np.zeros((*camera.shape, 3), np.float32) for camera in cameras]
    with progress.task("Dense stereo", total=rounds * len(captures)) as task:
        for level, scale in enumerate(scales):
            views = [
                _View.of(camera.scaled(scale), picture, limits)
                for camera, picture, limits in zip(cameras, pictures, depth_range_m, strict=True)
            ]
            planes = [_resampled(p, view.camera) for p, view in zip(planes, views, strict=True)]
            planes = _estimate_level(views, chosen, planes, settings, level, seed, task)
    return _depth_maps(views, chosen, planes, settings)


class _Picture(NamedTuple):
    """A capture's ``grey`` (H, W) and ``opponent`` colours (H, W, 2), as ``matching.Reference`` has them."""

    grey: np.ndarray
    opponent: np.ndarray

    @staticmethod
    def of(capture: Capture, camera: Camera) -> _Picture:
        image = capture.image()
        grey = without_noise(resize(image @ _LUMA, camera.width, camera.height))
        image = resize(image, camera.width, camera.height)
        red, green, blue = (without_noise(np.ascontiguousarray(channel)) for channel in np.moveaxis(image, -1, 0))
        return _Picture(grey, np.stack([red - green, 0.5 * (red + green) - blue], axis=-1))


@dataclass(frozen=True)
class _View:
    """A capture at one level of the pyramid, as the kernels take it."""

    camera: Camera
    reference: matching.Reference
    texels: np.ndarray

    @staticmethod
    def of(camera: Camera, picture: _Picture, depth_range_m: tuple[float, float]) -> _View:
        grey, opponent = (resize(one, camera.width, camera.height) for one in picture)
        opponent = np.ascontiguousarray(np.moveaxis(opponent, -1, 0), np.float32)
        near, far = depth_range_m
        lens = [camera.fx, camera.fy, camera.cx, camera.cy, 1.0 / far, 1.0 / near]
        reference = matching.Reference(grey, opponent, np.array(lens, np.float32))
        return _View(camera, reference, matching.pack_texels(grey))


def _check(captures: Sequence[Capture], depth_range_m: Sequence[tuple[float, float]]) -> None:
    if len(captures) < 2:
        raise GeometryError("stereo needs at least two photographs", where="captures", cure="Add more photographs.")
    for capture, (near, far) in zip(captures, depth_range_m, strict=True):
        if not 0.0 < near < far < np.inf:
            raise GeometryError(
                f"({near}, {far}) m is no depth range", where=capture.name, cure="Give two depths, 0 < near < far."
            )


def _nearest(cameras: Sequence[Camera], index: int) -> tuple[int, ...]:
    """The camera nearest to one, as its only source."""
    distance: list[float] = [float(np.linalg.norm(c.centre - cameras[index].centre)) for c in cameras]
    distance[index] = np.inf
    return (int(np.argmin(distance)),)


def _guessed_points(camera: Camera, depth_range_m: tuple[float, float]) -> np.ndarray:
    """Points half-way in inverse depth on a coarse grid of rays, for want of sparse ones."""
    depth = np.full(camera.shape, 2.0 / (1.0 / depth_range_m[0] + 1.0 / depth_range_m[1]))
    step = max(1, min(camera.shape) // 12)
    return camera.unproject(depth)[::step, ::step].reshape(-1, 3)


def _level_scales(cameras: Sequence[Camera], levels: int) -> list[float]:
    """The pyramid's scales, coarsest first, ending in 1."""
    longest = min(max(camera.shape) for camera in cameras)
    scales = [0.5**level for level in range(levels)]
    return [s for s in reversed(scales) if s == 1.0 or s * longest >= _MIN_LEVEL_SIDE_PX]


def _resampled(planes: np.ndarray, camera: Camera) -> np.ndarray:
    """The planes of a field at another size of its image, nearest pixel's."""
    height, width = planes.shape[:2]
    if (height, width) == camera.shape:
        return planes
    nearest = cv2.resize(planes, (camera.width, camera.height), interpolation=cv2.INTER_NEAREST)
    return nearest * np.array([width / camera.width, height / camera.height, 1.0], np.float32)


def _transfer(a: Camera, b: Camera) -> np.ndarray:
    """(3, 4) float32: (u, v, 1, inverse depth) of ``a`` to homogeneous pixels of ``b``."""
    b_from_a = b.camera_from_world @ a.world_from_camera
    infinite = b.matrix @ b_from_a[:3, :3] @ np.linalg.inv(a.matrix)
    return np.column_stack([infinite, b.matrix @ b_from_a[:3, 3]]).astype(np.float32)


def _sources(
    views: Sequence[_View],
    reference: int,
    chosen: Sequence[int],
    planes: Sequence[np.ndarray] | None = None,
    geometric_weight: float = 0.0,
) -> matching.Sources:
    """The chosen captures as sources of one reference, with their planes or without."""
    camera = views[reference].camera
    sizes = np.array([[views[j].camera.width, views[j].camera.height] for j in chosen], np.int64)
    starts = np.concatenate([[0], np.cumsum(sizes[:, 0] * sizes[:, 1])[:-1]])
    if planes is None:
        own = np.zeros((1, 3), np.float32)
    else:
        own = np.concatenate([planes[j].reshape(-1, 3) for j in chosen])
    return matching.Sources(
        texels=np.concatenate([views[j].texels for j in chosen]),
        layout=np.column_stack([starts, sizes]).astype(np.int32),
        to_source=np.stack([_transfer(camera, views[j].camera) for j in chosen]),
        to_reference=np.stack([_transfer(views[j].camera, camera) for j in chosen]),
        planes=own,
        geometric_weight=np.float32(geometric_weight),
    )


def _new_field(planes: np.ndarray, sources: int) -> patchmatch.Field:
    height, width = planes.shape[:2]
    cost = np.zeros((height, width), np.float32)
    return patchmatch.Field(planes.copy(), cost, np.zeros((height, width, sources), np.float32))


def _estimate_level(
    views: Sequence[_View],
    chosen: Sequence[Sequence[int]],
    planes: list[np.ndarray],
    settings: StereoSettings,
    level: int,
    seed: int,
    task: Task,
) -> list[np.ndarray]:
    """The planes after this level's photometric sweeps and geometric rounds."""
    window = matching.window(settings.patch_radius_px, settings.patch_stride_px)
    regions = patchmatch.sampling_regions()
    for stage in range(1 + settings.geometric_rounds):
        geometric = stage > 0
        sweeps = settings.geometric_sweeps if geometric else settings.iterations
        coarsest = level == 0 and not geometric
        following = []
        for i, view in enumerate(views):
            sources = (
                _sources(views, i, chosen[i], planes, settings.geometric_weight)
                if geometric
                else _sources(views, i, chosen[i])
            )
            field = _new_field(planes[i], len(chosen[i]))
            number = ((level * 16 + stage) * len(views) + i) * 64
            patchmatch.initialise(field.planes, view.reference, number, seed)
            patchmatch.score(field, view.reference, sources, window)
            for sweep in range(sweeps):
                fineness = np.float32(0.5 ** (sweep + (0 if coarsest else 2)))
                for colour in range(2):
                    patchmatch.half_sweep(
                        field, view.reference, sources, window, regions, colour, number + sweep + 1, fineness, seed
                    )
            following.append(field.planes)
            task.advance()
        planes = following
    return planes


def _depth_maps(
    views: Sequence[_View], chosen: Sequence[Sequence[int]], planes: Sequence[np.ndarray], settings: StereoSettings
) -> tuple[DepthMap, ...]:
    """Depth, normals, photometric cost and support of the final planes."""
    window = matching.window(settings.patch_radius_px, settings.patch_stride_px)
    depths, normals, costs = [], [], []
    for i, view in enumerate(views):
        field = _new_field(planes[i], len(chosen[i]))
        patchmatch.score(field, view.reference, _sources(views, i, chosen[i]), window)
        depth, normal = _depth_and_normal(field.planes, view.camera)
        depths.append(np.where(field.cost < matching.WORST_COST, depth, np.float32(0.0)))
        normals.append(normal)
        costs.append(field.cost)
    cameras = [view.camera for view in views]
    usable = [cost <= settings.max_cost for cost in costs]
    counts = support(cameras, depths, normals, usable, settings.consistency)
    return tuple(
        DepthMap(depth, normal, cost, _without_speckles(depth, count, settings), camera)
        for depth, normal, cost, count, camera in zip(depths, normals, costs, counts, cameras, strict=True)
    )


def _depth_and_normal(planes: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Depth (H, W) float32 and world normals (H, W, 3) float32 towards the camera."""
    u = np.arange(camera.width, dtype=np.float32) + 0.5
    v = np.arange(camera.height, dtype=np.float32)[:, None] + 0.5
    inverse_depth = planes[..., 0] * u + planes[..., 1] * v + planes[..., 2]
    away: np.ndarray = planes @ camera.matrix.astype(np.float32)
    away /= np.linalg.norm(away, axis=-1, keepdims=True)
    normal = -away @ camera.world_from_camera[:3, :3].T.astype(np.float32)
    return np.float32(1.0) / inverse_depth, normal


def _without_speckles(depth: np.ndarray, count: np.ndarray, settings: StereoSettings) -> np.ndarray:
    """``count`` with 0 on connected segments smaller than ``min_segment_share``."""
    # cv2 compares int16 values: steps of the logarithm make it a relative difference.
    logarithm = np.log(np.where(count > 0, depth, np.float32(1.0)).clip(1e-2, 1e2))
    labels = np.rint(logarithm * (_SEGMENT_STEPS / _SEGMENT_DIFFERENCE))
    labels = np.where(count > 0, labels, _NO_SEGMENT).astype(np.int16)
    smallest_px = round(settings.min_segment_share * depth.size)
    cv2.filterSpeckles(labels, _NO_SEGMENT, smallest_px, _SEGMENT_STEPS)
    return np.where(labels == _NO_SEGMENT, 0, count).astype(np.uint8)


DEPTH = each_capture(layout.DEPTH, DepthMap.load)
"""The dense stereo of each capture."""

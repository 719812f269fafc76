"""What the benchmark of the splats works on: a made-up room, or an asset and photographs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.poses.cameras_json import read_cameras_json, read_frozen
from r2sego_blender.captures.poses.json_fields import read_json
from r2sego_blender.captures.poses.photographs import ANY_SIZE_PX, capture_of
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import SettingsError
from r2sego_blender.core.images import resize
from r2sego_blender.geometry.collision.collision import CollisionSurface
from r2sego_blender.geometry.proxy.proxy import GeometryProxy, Provenance
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.formats.registry import load_asset
from r2sego_blender.splats.harmonics import SH_BAND_0
from r2sego_blender.splats.quaternions import from_rotation

_ROOM_M = ((-2.5, -2.0, 0.0), (2.5, 2.0, 2.6))
_FURNITURE_M = (
    ((-0.9, -0.5, 0.0), (0.9, 0.5, 0.75)),
    ((-2.4, -1.9, 0.0), (-1.8, 0.2, 1.9)),
    ((1.3, -1.8, 0.0), (2.3, -0.9, 0.45)),
    ((1.9, 0.4, 0.0), (2.4, 1.6, 1.2)),
)
"""Opposite corners of the room and of the boxes that stand in it."""

_WALL_M = 0.1

_CAMERA_M, _LOOKS_AT_M = (-1.9, 1.6, 1.5), (0.6, -0.5, 0.8)
_FIELD_OF_VIEW = 1.2
"""The image's width over the focal length: 62 degrees."""

_SIGMA_SHARE = 0.8
"""Typical long half axis over the mean distance of two Gaussians: trained assets overlap so."""
_SIGMA_SPREAD = 0.5
_NARROWEST, _THICKNESS = 0.2, 0.1
_LOGIT, _LOGIT_SPREAD = 1.0, 2.0
_HARMONICS_SPREAD = 0.05
_DEGREE = 3

_LARGEST_SIDE_PX = 16384
_ASPECT_TOLERANCE = 0.01


@dataclass(frozen=True)
class View:
    """A camera, and a function that loads the image (H, W, 3) float32 it is compared with."""

    camera: Camera
    image: Callable[[], np.ndarray]


@dataclass(frozen=True)
class Workload:
    """An asset, and the views that are rendered of it in turn."""

    asset: SplatAsset
    views: tuple[View, ...]
    source: str


def parse_size(text: str) -> tuple[int, int]:
    """(width, height) of ``WxH``. Raises SettingsError for anything else."""
    width, _, height = text.lower().partition("x")
    sides = [int(side) if side.isascii() and side.isdigit() else 0 for side in (width, height)]
    if not all(0 < side <= _LARGEST_SIDE_PX for side in sides):
        raise SettingsError(
            f"'{text}' is no size of images",
            where="--size",
            cure=f"Write WIDTHxHEIGHT in pixels, for example 640x480, up to {_LARGEST_SIDE_PX} a side.",
        )
    return sides[0], sides[1]


def made_up_room(gaussians: int, size: tuple[int, int], seed: int = 0) -> Workload:
    """A furnished room of ``gaussians`` flat, turned Gaussians of degree 3, seen from a corner.

    The image it is compared with is noise: the work does not depend on what it shows.
    """
    rng = np.random.default_rng(seed)
    width, height = size
    focal = width / _FIELD_OF_VIEW
    pose = look_at(np.array(_CAMERA_M), np.array(_LOOKS_AT_M))
    camera = Camera(width, height, focal, focal, width / 2, height / 2, pose)

    def noise() -> np.ndarray:
        return np.random.default_rng(seed).random((height, width, 3), np.float32)

    return Workload(_room(gaussians, rng), (View(camera, noise),), f"made-up room, seed {seed}")


def of_files(asset: Path, cameras: Path, size: tuple[int, int] | None = None) -> Workload:
    """An asset seen by the frozen views of a cameras.json, or by its captures if there are none.

    The photographs may be missing: grey is trained on then, which takes as long. The poses
    must be in the asset's frame. ``size`` (width, height) must have the views' shape. Raises
    AssetError or CaptureError for files that cannot be used, SettingsError for a size of
    another shape.
    """
    has_frozen = "frozen" in read_json(cameras)
    if has_frozen:
        photographs = read_frozen(cameras, cameras.parent, files_needed=False)
    else:
        photographs, _ = read_cameras_json(cameras, cameras.parent, files_needed=False)
    views = []
    for photograph in photographs:
        capture = capture_of(photograph, ANY_SIZE_PX, files_needed=False)
        camera = capture.camera if size is None else _sized(capture.camera, size)
        views.append(View(camera, partial(_target, capture, camera)))
    kind = "frozen views" if has_frozen else "captures"
    if not views:
        raise SettingsError(f"there are no {kind}", where=cameras, cure="Give a cameras.json with some.")
    return Workload(load_asset(asset), tuple(views), f"{asset.name}, {kind} of {cameras.name}")


def _target(capture: Capture, camera: Camera) -> np.ndarray:
    """The photograph in the camera's size; grey where it is not there."""
    if not capture.image_path.is_file():
        return np.full((*camera.shape, 3), 0.5, np.float32)
    return resize(capture.image(), camera.width, camera.height)


def _sized(camera: Camera, size: tuple[int, int]) -> Camera:
    width, height = size
    if abs(width / height / (camera.width / camera.height) - 1.0) > _ASPECT_TOLERANCE:
        raise SettingsError(
            f"the views are {camera.width}x{camera.height}, of another shape than {width}x{height}",
            where="--size",
            cure="Give a size of the same shape, or leave it away.",
        )
    across, down = width / camera.width, height / camera.height
    return replace(
        camera,
        width=width,
        height=height,
        fx=camera.fx * across,
        cx=camera.cx * across,
        fy=camera.fy * down,
        cy=camera.cy * down,
    )


def _room(count: int, rng: np.random.Generator) -> SplatAsset:
    """Gaussians spread evenly over all faces, flat along them, turned and stretched at random."""
    corners, edges = _faces()
    areas_m2 = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    face = rng.choice(len(areas_m2), count, p=areas_m2 / areas_m2.sum())
    means = corners[face] + np.einsum("nk,nkc->nc", rng.random((count, 2)), edges[face])

    along = edges / np.linalg.norm(edges, axis=2, keepdims=True)
    first, second = along[face].transpose(1, 0, 2)
    turn = rng.uniform(0.0, np.pi, (count, 1))
    axes = [
        np.cos(turn) * first + np.sin(turn) * second,
        np.cos(turn) * second - np.sin(turn) * first,
        np.cross(first, second),
    ]
    spacing_m = np.sqrt(areas_m2.sum() / max(count, 1))
    sigma = np.empty((count, 3))
    sigma[:, 0] = _SIGMA_SHARE * spacing_m * np.exp(_SIGMA_SPREAD * rng.normal(size=count))
    sigma[:, 1] = sigma[:, 0] * rng.uniform(_NARROWEST, 1.0, count)
    sigma[:, 2] = sigma[:, 1] * _THICKNESS

    sh = rng.normal(scale=_HARMONICS_SPREAD, size=(count, (_DEGREE + 1) ** 2, 3))
    sh[:, 0] += 0.3 * np.sin(3.0 * means) / SH_BAND_0
    return SplatAsset(
        means=means,
        log_scales=np.log(sigma),
        quaternions=from_rotation(np.stack(axes, axis=2)),
        logit_opacities=rng.normal(_LOGIT, _LOGIT_SPREAD, count),
        sh=sh,
    )


def made_up_proxy(triangles: int) -> GeometryProxy:
    """The same room as a geometry proxy of about ``triangles`` equal triangles, all seen by a capture."""
    corners, edges = _faces()
    sizes_m = np.linalg.norm(edges, axis=2)
    spacing_m = np.sqrt(2.0 * np.prod(sizes_m, axis=1).sum() / triangles)
    vertices, faces, count = [], [], 0
    for number, (corner, (first, second), sizes) in enumerate(zip(corners, edges, sizes_m, strict=True)):
        rows, columns = (max(1, round(size / spacing_m)) for size in sizes)
        a, b = np.meshgrid(np.linspace(0.0, 1.0, rows + 1), np.linspace(0.0, 1.0, columns + 1), indexing="ij")
        vertices.append((corner + a[..., None] * first + b[..., None] * second).reshape(-1, 3))
        place = count + np.arange((rows + 1) * (columns + 1)).reshape(rows + 1, columns + 1)
        quads = np.stack([place[:-1, :-1], place[1:, :-1], place[1:, 1:], place[:-1, 1:]], -1).reshape(-1, 4)
        faces_in = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
        # A face's normal is first x second: of the axes in turn, + - +; boxes are seen from outside.
        axis, is_high, is_room = number % 6 // 2, number % 2, number < 6
        points_up = axis != 1
        faces.append(faces_in if points_up != (is_high == is_room) else faces_in[:, ::-1])
        count += place.size
    whole = np.concatenate(faces)
    return GeometryProxy(
        np.concatenate(vertices).astype(np.float32),
        np.ascontiguousarray(whole, np.int32),
        np.full(len(whole), Provenance.OBSERVED, np.uint8),
        np.ones(len(whole), np.uint16),
        np.ones(len(whole), np.float32),
    )


def made_up_collision() -> CollisionSurface:
    """The same room as a robot meets it: walls, ceiling and furniture as boxes on a flat floor."""
    proxy = made_up_proxy(1)
    low, high = (np.array(corner) for corner in _ROOM_M)
    boxes = [(np.array(near), np.array(far)) for near, far in _FURNITURE_M]
    for axis in range(3):
        for side in ((high, high + _WALL_M), (low - _WALL_M, low)):
            if axis == 2 and side[0] is not high:
                continue
            near, far = low.copy(), high.copy()
            near[axis], far[axis] = side[0][axis], side[1][axis]
            boxes.append((near, far))
    floor = np.array([[x, y, 0.0] for x, y in _around(low, high)])
    pieces = tuple(_box(near, far) for near, far in boxes)
    return CollisionSurface(proxy.vertices.astype(np.float64), proxy.faces, pieces, floor, tolerance_m=0.0)


def made_up_path(lens: Camera, count: int) -> list[Camera]:
    """``count`` views from a robot's height, around the room's middle, looking down and about."""
    turn = np.linspace(0.0, 8.0 * np.pi, count)
    centres = np.stack([1.6 * np.cos(turn), 1.2 * np.sin(turn), np.full(count, 1.25)], axis=1)
    gaze = turn + np.pi + 1.2 * np.sin(7.0 * turn)
    ahead = np.stack([np.cos(gaze), np.sin(gaze), -0.6 + 0.3 * np.sin(11.0 * turn)], axis=1)
    return [lens.at(look_at(centre, centre + to)) for centre, to in zip(centres, ahead, strict=True)]


def _around(low: np.ndarray, high: np.ndarray) -> list[tuple[float, float]]:
    """The corners of a rectangle, counter-clockwise."""
    return [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]


def _box(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A closed box, its faces counter-clockwise from outside."""
    around = _around(low, high)
    vertices = np.array([(x, y, z) for z in (low[2], high[2]) for x, y in around])
    sides = [[3, 2, 1, 0], [4, 5, 6, 7], *([k, (k + 1) % 4, (k + 1) % 4 + 4, k + 4] for k in range(4))]
    return vertices, np.array([[a, *pair] for a, b, c, d in sides for pair in ((b, c), (c, d))], np.int32)


def _faces() -> tuple[np.ndarray, np.ndarray]:
    """Corner (F, 3) and the two edges (F, 2, 3) of every box's six rectangles, metres."""
    corners, edges = [], []
    for box in (_ROOM_M, *_FURNITURE_M):
        low, high = np.array(box[0]), np.array(box[1])
        for axis in range(3):
            across = [np.eye(3)[k] * (high - low) for k in range(3) if k != axis]
            for corner in (low, np.where(np.arange(3) == axis, high, low)):
                corners.append(corner)
                edges.append(across)
    return np.array(corners), np.array(edges)

"""How a shape that is placed by hand fits its object's masks and observed points. NumPy alone.

The engine's alignment draws faces; here the surface's samples are splatted into small images,
which takes milliseconds, so that the figures follow the mouse.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core.cameras import Camera

WINDOW_PX = 72
"""The longer side of the small images, around the mask."""

SAMPLES = 16_000
HIDING_M = 0.08  # known depth that is this much nearer than the shape may hide it, as in the alignment
_NEAR_M = 0.05
_MARGIN = 0.5  # of the mask's box, on each side


@dataclass(frozen=True)
class MaskWindow:
    """A capture's small image around an object: ``camera``, ``mask`` (H, W) bool, and the ``depth``
    (H, W) float32 metres known there, 0 = unknown."""

    name: str
    camera: Camera
    mask: np.ndarray
    depth: np.ndarray


@dataclass(frozen=True)
class Fit:
    """``ious`` of the windows in their order, and their mean; nan without any."""

    ious: tuple[float, ...]

    @property
    def iou(self) -> float:
        """The mean over the captures that show the object."""
        return float(np.mean(self.ious)) if self.ious else float("nan")


def surface_samples(vertices: np.ndarray, faces: np.ndarray, count: int = SAMPLES) -> np.ndarray:
    """(count, 3) float32: points spread evenly over a mesh's surface, always the same."""
    a, b, c = (np.asarray(vertices, np.float64)[faces[:, k]] for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    if not areas.sum() > 0.0:
        return np.asarray(vertices, np.float32)
    rng = np.random.default_rng(0)
    places = (np.arange(count) + rng.random(count)) / count  # one in each part: no gaps, no clumps
    chosen = np.searchsorted(np.cumsum(areas) / areas.sum(), places).clip(0, len(areas) - 1)
    u, v = np.sqrt(rng.random(count)), rng.random(count)
    weights = np.stack([1.0 - u, u * (1.0 - v), u * v], axis=1)
    corners = np.stack([a[chosen], b[chosen], c[chosen]], axis=1)
    return np.einsum("nk,nkd->nd", weights, corners).astype(np.float32)


def mask_window(name: str, camera: Camera, mask: np.ndarray, depth: np.ndarray | None = None) -> MaskWindow | None:
    """The small image around a ``mask`` (H, W) bool of ``camera``; None for an empty one.

    ``depth`` (H, W) planar metres, 0 = unknown.
    """
    rows, columns = (np.flatnonzero(mask.any(1 - axis)) for axis in range(2))
    if not len(rows):
        return None
    sides = []
    for used, size in ((columns, camera.width), (rows, camera.height)):
        margin = 2 + _MARGIN * (used[-1] - used[0] + 1)
        sides.append((max(0.0, used[0] - margin), min(float(size), used[-1] + 1 + margin)))
    (left, right), (top, bottom) = sides
    share = min(1.0, WINDOW_PX / max(right - left, bottom - top))
    width, height = (max(1, round((end - start) * share)) for start, end in sides)
    sx, sy = width / (right - left), height / (bottom - top)
    small = Camera(
        width,
        height,
        camera.fx * sx,
        camera.fy * sy,
        (camera.cx - left) * sx,
        (camera.cy - top) * sy,
        camera.world_from_camera,
    )
    x = np.clip((left + (np.arange(width) + 0.5) / sx).astype(int), 0, camera.width - 1)
    y = np.clip((top + (np.arange(height) + 0.5) / sy).astype(int), 0, camera.height - 1)
    known = np.zeros(mask.shape, np.float32) if depth is None else depth
    return MaskWindow(name, small, mask[np.ix_(y, x)], np.asarray(known[np.ix_(y, x)], np.float32))


def silhouette(camera: Camera, points: np.ndarray) -> np.ndarray:
    """(H, W) float32: the depth of the nearest surface sample (N, 3) in the world at each pixel, 0 = none.

    Pixels that fall between samples are closed from their neighbours.
    """
    pose = camera.camera_from_world.astype(np.float32)
    x, y, z = pose[:3, :3] @ points.T + pose[:3, 3:]
    ahead = z > _NEAR_M
    inverse = 1.0 / np.where(ahead, z, 1.0)
    column = np.floor(x * inverse * np.float32(camera.fx) + np.float32(camera.cx)).astype(np.int64)
    row = np.floor(y * inverse * np.float32(camera.fy) + np.float32(camera.cy)).astype(np.int64)
    inside = ahead & (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
    flat = row[inside] * camera.width + column[inside]
    nearest = np.zeros(camera.width * camera.height, np.float32)
    np.maximum.at(nearest, flat, inverse[inside])
    nearest = nearest.reshape(camera.shape)
    nearest = _closed(nearest)
    return np.divide(1.0, nearest, out=np.zeros_like(nearest), where=nearest > 0.0)


def fit_of(windows: Sequence[MaskWindow], points: np.ndarray) -> Fit:
    """The overlap of the shape's silhouette with each mask, ``points`` (N, 3) on it, in the world.

    As in the alignment, what the shape covers outside the mask counts only where nothing known
    stands before it.
    """
    ious = []
    for window in windows:
        depth = silhouette(window.camera, points)
        drawn = depth > 0.0
        hidden = (window.depth > 0.0) & (window.depth < depth - HIDING_M)
        union = (window.mask | (drawn & ~hidden)).sum()
        ious.append(float((drawn & window.mask).sum() / union) if union else 0.0)
    return Fit(tuple(ious))


def outline(inside: np.ndarray) -> np.ndarray:
    """(2 S, 2) float32: the border of a region (H, W) bool, S segments in its pixels from the top left."""
    padded = np.pad(inside, 1)
    rows, columns = np.nonzero(padded[1:, 1:-1] != padded[:-1, 1:-1])  # between row r - 1 and r
    level = np.stack([np.stack([columns, rows], 1), np.stack([columns + 1, rows], 1)], axis=1)
    rows, columns = np.nonzero(padded[1:-1, 1:] != padded[1:-1, :-1])
    upright = np.stack([np.stack([columns, rows], 1), np.stack([columns, rows + 1], 1)], axis=1)
    return np.concatenate([level, upright]).reshape(-1, 2).astype(np.float32)


def _closed(inverse: np.ndarray) -> np.ndarray:
    """The image with single gaps filled: by the nearest neighbour where five of eight are there."""
    padded = np.pad(inverse, 1)
    rows, columns = inverse.shape
    around = [padded[dy : dy + rows, dx : dx + columns] for dy in range(3) for dx in range(3) if (dy, dx) != (1, 1)]
    near = np.sum([one > 0.0 for one in around], axis=0) >= 5
    return np.where((inverse == 0.0) & near, np.max(around, axis=0), inverse)

"""The depth a sensor measured, brought to the captures: aligned, cleaned, in the world's metres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from ...bundle.layout import mask_stems
from ...core.cameras import Camera
from ...core.progress import SILENT, Progress
from ..capture import Capture
from ..sparse_points import SparsePoints
from .alignment import SensorPose, camera_points, estimate_sensor_pose
from .cleaning import believed
from .sensor_depth import SensorDepth
from .sensor_maps import SensorMap

_CRACK_NEIGHBOURS = 5  # of eight that are known: a pixel that reprojection left open between them


def measured_depth(
    captures: Sequence[Capture],
    sparse: SparsePoints,
    depth: SensorDepth,
    metres_per_unit: float,
    progress: Progress = SILENT,
) -> dict[str, SensorMap]:
    """The sensor's maps of those captures that have one, by the captures' names.

    Captures and ``sparse`` are in the world, of whose metres the sensor's are ``metres_per_unit``. How
    the sensor stands to the camera is estimated and corrected, and told. Raises CaptureError for a
    damaged map.
    """
    stems = mask_stems([capture.name for capture in captures])
    straight: list[tuple[np.ndarray, np.ndarray] | None] = []
    for capture in captures:
        found = depth.with_doubt(capture, stems[capture.name])
        straight.append(found and straightened(capture, found[0] / np.float32(metres_per_unit), found[1]))
    pose = estimate_sensor_pose(captures, sparse, [one and one[0] for one in straight])
    if not pose.is_aligned:
        progress.message(f"the depth sensor does not see what the camera does: it is {pose}; corrected")
    maps = {}
    for capture, one in zip(captures, straight, strict=True):
        if one is not None:
            camera = capture.camera.fitted(max(one[0].shape))
            seen = one if pose.is_aligned else _reprojected(*one, camera, pose)
            maps[capture.name] = SensorMap(*believed(*seen, camera), camera)
    return maps


def straightened(capture: Capture, depth: np.ndarray, doubt: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A map (h, w) of the upright photograph as the capture's camera sees it, of about the same resolution,
    and its ``doubt`` likewise. Both float32, of ``capture.camera.fitted(max(h, w))``.

    Each pixel takes the nearest measurement: depth is not to be mixed.
    """
    camera = capture.camera.fitted(max(depth.shape))
    if (capture.lens is None or capture.lens.plain) and camera.shape == depth.shape:
        return depth, doubt
    v, u = np.mgrid[: camera.height, : camera.width] + 0.5
    finer = [capture.camera.width / camera.width, capture.camera.height / camera.height]
    shares = capture.photograph_shares(np.stack([u.ravel(), v.ravel()], axis=1) * finer)
    height, width = depth.shape
    column, row = np.floor(shares * [width, height]).astype(int).T
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    column, row = column.clip(0, width - 1), row.clip(0, height - 1)
    values = np.where(inside, depth[row, column], 0.0).astype(np.float32)
    return values.reshape(camera.shape), doubt[row, column].reshape(camera.shape)


def _reprojected(
    depth: np.ndarray, doubt: np.ndarray, camera: Camera, pose: SensorPose
) -> tuple[np.ndarray, np.ndarray]:
    """What the sensor measured, seen from the camera; the nearest counts, and cracks are closed."""
    row, column = np.nonzero(depth > 0.0)
    points = camera_points(camera, depth, row, column) / [pose.focal_ratio, pose.focal_ratio, 1.0]
    points = points @ pose.camera_from_sensor[:3, :3].T + pose.camera_from_sensor[:3, 3]
    ahead = points[:, 2] > 1e-3
    points, doubts = points[ahead], doubt[row, column][ahead]
    u = np.floor(points[:, 0] / points[:, 2] * camera.fx + camera.cx).astype(int)
    v = np.floor(points[:, 1] / points[:, 2] * camera.fy + camera.cy).astype(int)
    inside = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    # Written from far to near, so that the nearest stays.
    order = np.flatnonzero(inside)[np.argsort(-points[inside, 2], kind="stable")]
    seen, seen_doubt = np.zeros(camera.shape, np.float32), np.ones(camera.shape, np.float32)
    seen[v[order], u[order]], seen_doubt[v[order], u[order]] = points[order, 2], doubts[order]
    return _without_cracks(seen), seen_doubt


def _without_cracks(depth: np.ndarray) -> np.ndarray:
    """A single unknown pixel among known ones takes the median of these; it hides nothing nearer."""
    known = ndimage.uniform_filter((depth > 0.0).astype(np.float32), 3, mode="constant") * 9.0
    crack = (depth <= 0.0) & (np.rint(known) >= _CRACK_NEIGHBOURS)
    rows, columns = np.nonzero(crack)
    around = np.pad(depth, 1)
    values = np.stack([around[rows + y, columns + x] for y in range(3) for x in range(3)], axis=1)
    filled = depth.copy()
    filled[crack] = np.nanmedian(np.where(values > 0.0, values, np.nan), axis=1) if len(rows) else 0.0
    return filled

"""Agreement of depth maps: whether what one capture sees lies where another sees it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...core.cameras import Camera
from ...core.compiled import parallel_kernel, prange

# Normals agree up to 45 degrees: those of PatchMatch are coarse on weak texture.
_MIN_NORMAL_COSINE = np.float32(0.7)


def agreement(
    points: np.ndarray,
    camera: Camera,
    depth: np.ndarray,
    normal: np.ndarray,
    tolerance: float,
    point_normals: np.ndarray | None = None,
) -> np.ndarray:
    """(...,) bool: which world points (..., 3) lie on the surface a depth map shows there.

    ``depth`` (H, W) metres and ``normal`` (H, W, 3) world are of ``camera``. The surface
    is each pixel's plane, met by the ray of the point, so that a steep surface does not
    disagree by the rounding to a pixel; ``tolerance`` is a share of the depth. With
    ``point_normals`` (..., 3) the normals must agree as well: wrong depths meet by chance
    far more often than wrong planes do.
    """
    camera_from_world = camera.camera_from_world.astype(np.float32)
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32)
    flat = np.ascontiguousarray(points.reshape(-1, 3), np.float32)
    normals = np.zeros((0, 3)) if point_normals is None else point_normals.reshape(-1, 3)
    normals = np.ascontiguousarray(normals, np.float32)
    agrees = np.zeros(len(flat), np.bool_)
    _agreement(flat, normals, camera_from_world, lens, depth, normal, np.float32(tolerance), agrees)
    return agrees.reshape(points.shape[:-1])


def support(
    cameras: Sequence[Camera],
    depths: Sequence[np.ndarray],
    normals: Sequence[np.ndarray],
    usable: Sequence[np.ndarray],
    tolerance: float,
) -> tuple[np.ndarray, ...]:
    """For each depth map (H, W) uint8, the number of other captures that agree with it, 255 at most.

    Only pixels that are ``usable`` (H, W) bool agree or count."""
    kept = [np.where(mask, depth, np.float32(0.0)) for mask, depth in zip(usable, depths, strict=True)]
    counts = []
    for i, camera in enumerate(cameras):
        points = camera.unproject(kept[i])
        count = np.zeros(camera.shape, np.int32)
        for j, other in enumerate(cameras):
            if j != i:
                count += agreement(points, other, kept[j], normals[j], tolerance, normals[i])
        counts.append(np.where(usable[i], count.clip(max=255), 0).astype(np.uint8))
    return tuple(counts)


@parallel_kernel
def _agreement(points, normals, camera_from_world, lens, depth, normal, tolerance, agrees):
    height, width = depth.shape
    m = camera_from_world
    for p in prange(points.shape[0]):
        px, py, pz = points[p, 0], points[p, 1], points[p, 2]
        z = m[2, 0] * px + m[2, 1] * py + m[2, 2] * pz + m[2, 3]
        if z < np.float32(1e-3):
            continue
        rx = (m[0, 0] * px + m[0, 1] * py + m[0, 2] * pz + m[0, 3]) / z
        ry = (m[1, 0] * px + m[1, 1] * py + m[1, 2] * pz + m[1, 3]) / z
        u, v = lens[0] * rx + lens[2], lens[1] * ry + lens[3]
        if not (u >= 0.0 and v >= 0.0 and u < width and v < height):
            continue
        column, row = int(u), int(v)
        seen = depth[row, column]
        if seen <= 0.0:
            continue
        # The pixel's plane, n . X = depth * n . ray(pixel centre), met by the point's ray.
        wx, wy, wz = normal[row, column, 0], normal[row, column, 1], normal[row, column, 2]
        if normals.shape[0] > 0:
            cosine = normals[p, 0] * wx + normals[p, 1] * wy + normals[p, 2] * wz
            if cosine < _MIN_NORMAL_COSINE:
                continue
        nx = m[0, 0] * wx + m[0, 1] * wy + m[0, 2] * wz
        ny = m[1, 0] * wx + m[1, 1] * wy + m[1, 2] * wz
        nz = m[2, 0] * wx + m[2, 1] * wy + m[2, 2] * wz
        cx, cy = (column + np.float32(0.5) - lens[2]) / lens[0], (row + np.float32(0.5) - lens[3]) / lens[1]
        along = nx * rx + ny * ry + nz
        if abs(along) > np.float32(1e-2):
            seen *= (nx * cx + ny * cy + nz) / along
        agrees[p] = abs(seen - z) < tolerance * z

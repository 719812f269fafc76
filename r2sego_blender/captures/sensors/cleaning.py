"""What of a sensor's depth map is believed, and how far: no flying pixels, nothing seen edge-on."""

from __future__ import annotations

import cv2
import numpy as np

from ...core.cameras import Camera

SENSOR_SIGMA = 0.01
"""Relative standard deviation of depth seen squarely: about what LiDAR of phones, structured light and
time of flight are off by within three metres (for the Kinect Khoshelham and Elberink, Sensors 2012)."""

_GROWS_FROM_M = 3.0  # farther off the relative error of triangulating sensors grows with distance
_LEAST_COSINE = 0.15  # of the angle between the ray and the surface's normal
_JUMP = 0.04  # relative depth between neighbours of different surfaces


def believed(depth: np.ndarray, doubt: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """A depth map (H, W) of ``camera`` in metres without what lies between two surfaces, and its sigma in metres.

    ``doubt`` (H, W) multiplies the usual error. Both float32, 0 where unknown.
    """
    _, cosine = normals(depth, camera)
    kept = (depth > 0.0) & (cosine >= _LEAST_COSINE) & ~_flying(depth)
    farther = np.maximum(depth / _GROWS_FROM_M, 1.0)
    sigma = SENSOR_SIGMA * depth * farther * doubt / np.maximum(cosine, _LEAST_COSINE)
    return np.where(kept, depth, 0.0).astype(np.float32), np.where(kept, sigma, 0.0).astype(np.float32)


def normals(depth: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """World normals (H, W, 3) float32 towards the camera, and the cosine (H, W) under which it sees them.

    Both are 0 where depth is unknown. Beside an edge the differences are one-sided, on the surface's own side.
    """
    inverse = np.where(depth > 0.0, 1.0 / np.maximum(depth, 1e-6), 0.0)
    right, down = (_slope(inverse, axis) for axis in (1, 0))
    # 1 / z = q . ray is a plane with the normal q: its derivatives by pixels and its value tell q.
    rays = camera.rays()
    q = np.empty((*depth.shape, 3))
    q[..., 0], q[..., 1] = right * camera.fx, down * camera.fy
    q[..., 2] = inverse - q[..., 0] * rays[..., 0] - q[..., 1] * rays[..., 1]
    length = np.linalg.norm(q, axis=2)
    known = (depth > 0.0) & (length > 0.0)
    local = np.where(known[..., None], -q / np.where(known, length, 1.0)[..., None], 0.0)
    cosine = np.abs(np.einsum("hwc,hwc->hw", local, rays)) / np.linalg.norm(rays, axis=2)
    return (local @ camera.world_from_camera[:3, :3].T).astype(np.float32), cosine.astype(np.float32)


def _slope(inverse: np.ndarray, axis: int) -> np.ndarray:
    """The derivative of inverse depth along an axis: the smaller of the one-sided differences, 0 at lone pixels.

    Averaged with the other where both are of one surface.
    """
    after = np.diff(inverse, axis=axis, append=np.take(inverse, [-1], axis))
    before = np.roll(after, 1, axis)
    both = np.roll(inverse, -1, axis), np.roll(inverse, 1, axis)
    last = [slice(None)] * 2
    last[axis] = slice(-1, None)
    first = [slice(None)] * 2
    first[axis] = slice(0, 1)
    there = [inverse > 0.0] * 2
    there = [mask & (other > 0.0) for mask, other in zip(there, both, strict=True)]
    there[0][tuple(last)] = False
    there[1][tuple(first)] = False
    sizes = [np.where(mask, np.abs(step), np.inf) for mask, step in zip(there, (after, before), strict=True)]
    nearest = np.where(sizes[0] <= sizes[1], after, before)
    alike = there[0] & there[1] & (np.abs(after - before) < _JUMP * inverse)
    slope = np.where(alike, 0.5 * (after + before), nearest)
    return np.where(there[0] | there[1], slope, 0.0)


def _flying(depth: np.ndarray) -> np.ndarray:
    """(H, W) bool: pixels with something clearly nearer on one side and clearly farther on the other.

    Sensors mix the two surfaces of an edge there. Holes count as neither.
    """
    kernel = np.ones((3, 3), np.uint8)
    nearest = cv2.erode(np.where(depth > 0.0, depth, np.float32(np.inf)).astype(np.float32), kernel)
    farthest = cv2.dilate(depth.astype(np.float32), kernel)
    return (depth > 0.0) & (nearest < depth * (1.0 - _JUMP)) & (farthest > depth * (1.0 + _JUMP))

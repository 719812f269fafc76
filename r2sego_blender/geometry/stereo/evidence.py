"""What reliable depth maps say about points: seen there, seen through, or hidden.

A point that a capture's reliable depth passes *through* contradicts that capture: its
free space is not free. The count of such captures tells wrong depth from right better
than any matching cost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ...core.cameras import Camera
from ...core.compiled import inlined, parallel_kernel, prange
from ..visibility.projection import depth_of, pixel_of

FREE_MARGIN = 0.04
"""Relative depth beyond which a capture sees through a point."""


@dataclass(frozen=True)
class KnownDepth:
    """Reliable depth of one camera: ``depth`` (H, W) float32 planar metres, 0 = unknown."""

    camera: Camera
    depth: np.ndarray


@dataclass(frozen=True)
class Votes:
    """Per point, (P,) uint16: views that ``agree`` on a surface there, that see ``through``
    it, and that see something nearer in ``front``; the others do not see it reliably."""

    agree: np.ndarray
    through: np.ndarray
    front: np.ndarray


def collect_votes(
    points: np.ndarray,
    views: Sequence[KnownDepth],
    tolerance: float,
    normals: np.ndarray | None = None,
    least_cosine: float = 0.0,
) -> Votes:
    """Ask every view about every point (P, 3); depths within the relative ``tolerance`` agree.

    With ``normals`` (P, 3), unit, only views that look at a point's front under at least
    ``least_cosine`` can agree: an edge-on surface agrees with anything.
    """
    points = np.ascontiguousarray(points, np.float64).reshape(-1, 3)
    if normals is None:
        normals, least_cosine = np.zeros((0, 3)), -1.0
    normals = np.ascontiguousarray(normals, np.float64)
    votes = np.zeros((3, len(points)), np.uint16)
    for view in views:
        pose = view.camera.camera_from_world[:3]
        lens = np.array([view.camera.fx, view.camera.fy, view.camera.cx, view.camera.cy])
        depth = np.ascontiguousarray(view.depth, np.float32)
        _vote(points, normals, least_cosine, view.camera.centre.copy(), pose, lens, depth, tolerance, votes)
    return Votes(*votes)


def seen_by_others(camera: Camera, others: Sequence[KnownDepth], own: np.ndarray) -> np.ndarray:
    """(H, W) float32 depth in ``camera`` of what other captures know, where it is visible there; 0 elsewhere.

    ``own`` (H, W) is what ``camera`` itself knows, 0 elsewhere: nothing is seen behind it.
    """
    height, width = camera.shape
    seen: np.ndarray = np.full(height * width, np.inf, np.float32)
    for other in others:
        pixels, depth = camera.project(other.camera.unproject(other.depth)[other.depth > 0])
        inside = camera.sees(pixels, depth)
        u, v = pixels[inside].astype(np.int64).T
        np.minimum.at(seen, v * width + u, depth[inside].astype(np.float32))
    seen = seen.reshape(height, width)
    nearest = np.minimum(seen, np.where(own > 0, own, np.inf))
    front = ndimage.minimum_filter(nearest, size=7)
    visible = np.isfinite(seen) & (seen < front * 1.05)  # farther points show through gaps
    return np.where(visible, seen, 0).astype(np.float32)


@parallel_kernel
def _vote(points, normals, least_cosine, centre, pose, lens, depth, tolerance, votes):
    height, width = depth.shape
    for i in prange(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        forward = depth_of(pose, x, y, z)
        if forward < 1e-3:
            continue
        u, v = pixel_of(pose, lens, x, y, z, forward)
        if not (0.0 <= u < width and 0.0 <= v < height):
            continue
        known = depth[int(v), int(u)]
        if known <= 0.0:
            continue
        if known > forward * (1.0 + tolerance):
            votes[1, i] += 1
        elif known < forward * (1.0 - tolerance):
            votes[2, i] += 1
        elif least_cosine < 0.0 or _cosine(points, normals, centre, i) >= least_cosine:
            votes[0, i] += 1


@inlined
def _cosine(points, normals, centre, i):
    x, y, z = centre[0] - points[i, 0], centre[1] - points[i, 1], centre[2] - points[i, 2]
    length = np.sqrt(x * x + y * y + z * z)
    return (normals[i, 0] * x + normals[i, 1] * y + normals[i, 2] * z) / length

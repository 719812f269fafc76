"""Walls that bound a room elsewhere, and behind which a photograph sees: a corridor's wall, and its niche.

The envelope of a room is convex, its walls are whole planes. Where most of what a capture measured in a wall's
direction lies behind it, the wall does not bound what that capture sees: it recedes to what lies behind. Below the
lowest of those points it stays, for what was seen may lie on a counter, whose front it is.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from ...core.cameras import Camera
from .planes import RoomPlanes
from .point_evidence import PointEvidence

_BEHIND_SHARE, _BEHIND_M = 0.1, 0.05  # of the depth, and more, from which on a point lies behind a wall
_FEWEST, _MOST_BEFORE = 20, 0.5  # points behind it, and the share that may lie on it or before it
_FARTHEST_SHARE, _LOWEST_SHARE = 0.1, 0.05  # of those points, which may be wrong


def receded(camera: Camera, points: PointEvidence, planes: RoomPlanes) -> tuple[RoomPlanes, np.ndarray]:
    """The ``planes`` as they bound what ``camera`` sees, by the ``points`` that it measured; and (H, W) float32 the
    planar depth of walls that receded, in metres, where they stay: 0 elsewhere.

    A wall that recedes is among the planes as it was, too, bounding nothing.
    """
    stays = np.zeros(camera.shape, np.float32)
    if len(points.depth) < _FEWEST:
        return planes, stays
    offsets, moved = planes.offsets.copy(), np.zeros(len(planes.offsets), bool)
    walls = planes.bounding & (np.abs(planes.normals[:, 2]) < 0.5)
    depths = planes.depths(camera)
    for index in np.flatnonzero(walls):
        wall = depths[index]
        before = wall[points.rows, points.columns]
        behind = (before > 0.0) & (points.depth > (1.0 + _BEHIND_SHARE) * before + _BEHIND_M)
        if behind.sum() < _FEWEST or behind.sum() < _MOST_BEFORE * (before > 0.0).sum():
            continue
        seen = points.world[behind]
        offsets[index], moved[index] = np.quantile(seen @ planes.normals[index], _FARTHEST_SHARE), True
        low = camera.unproject(wall)[..., 2] < np.quantile(seen[:, 2], _LOWEST_SHARE)
        stays = np.where((wall > 0.0) & low & ((stays <= 0.0) | (wall < stays)), wall, stays)
    if not moved.any():
        return planes, stays
    as_was = planes.normals[moved], planes.offsets[moved], planes.inliers[moved]
    return dataclasses.replace(planes, offsets=offsets).with_more(*as_was, bounding=False), stays

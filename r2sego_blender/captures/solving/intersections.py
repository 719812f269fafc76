"""Points where the rays of tracks meet, for poses that may be wrong."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.cameras import Camera

# Rays this far apart tell a depth.
_LEAST_ANGLE_RAD = np.radians(1.0)
# Cauchy's width, in pixels, of rays that miss the others, and how often rays are weighed anew.
_LOSS_PX = 4.0
_ROUNDS = 4


class Intersections(NamedTuple):
    """Points (P, 3) float64; the errors (P, N) of their projections in pixels, NaN where nothing was measured,
    infinite behind a camera; and whether (P,) rays are far enough apart to tell their depth."""

    points: np.ndarray
    errors_px: np.ndarray
    known: np.ndarray


def intersections(cameras: Sequence[Camera], pixels: np.ndarray) -> Intersections:
    """The points nearest to the rays of tracks (P, N, 2), in pixels, by reweighted least squares."""
    seen = np.isfinite(pixels[..., 0])
    rays = np.zeros((*seen.shape, 3))
    for index, camera in enumerate(cameras):
        local = np.ones((seen[:, index].sum(), 3))
        local[:, :2] = (pixels[seen[:, index], index] - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
        local /= np.linalg.norm(local, axis=1, keepdims=True)
        rays[seen[:, index], index] = local @ camera.world_from_camera[:3, :3].T
    centres = np.array([camera.centre for camera in cameras])
    across = np.eye(3) - rays[..., :, None] * rays[..., None, :]
    weight = seen.astype(np.float64)
    for _ in range(_ROUNDS):
        normal = np.einsum("pn,pnij->pij", weight, across)
        floor = 1e-12 * np.trace(normal, axis1=1, axis2=2) + 1e-300
        right = np.einsum("pn,pnij,nj->pi", weight, across, centres)
        points = np.linalg.solve(normal + floor[:, None, None] * np.eye(3), right[..., None])[..., 0]
        errors_px = reprojected(cameras, points, pixels)
        distances = np.linalg.norm(points[:, None] - centres, axis=2)
        distances /= np.maximum(np.median(distances, axis=1, keepdims=True), 1e-300)
        loss = 1.0 / (1.0 + np.square(np.where(seen, np.minimum(errors_px, 1e6), 0.0) / _LOSS_PX))
        weight = np.where(seen, loss / np.clip(distances, 1e-6, 1e6) ** 2, 0.0)
    flat = np.einsum("pn,pnij->pij", seen.astype(np.float64), across)
    known = np.linalg.eigvalsh(flat)[:, 0] >= 1.0 - np.cos(_LEAST_ANGLE_RAD)
    return Intersections(points, errors_px, known & (seen.sum(axis=1) >= 2))


def reprojected(cameras: Sequence[Camera], points: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """(P, N) pixels from measurements (P, N, 2) to the points' projections; NaN and infinite as above."""
    errors = np.full(pixels.shape[:2], np.nan)
    for index, camera in enumerate(cameras):
        rows = np.isfinite(pixels[:, index, 0])
        projected, depth = camera.project(points[rows])
        off = np.linalg.norm(projected - pixels[rows, index], axis=1)
        errors[rows, index] = np.where(depth > 0.0, off, np.inf)
    return errors

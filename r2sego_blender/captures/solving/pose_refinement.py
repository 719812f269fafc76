"""A camera's pose and focal length refined on points whose own place is uncertain.

Gauss-Newton over the camera's centre, rotation and focal length with Huber's loss. A point
that may lie elsewhere along a line blurs its pixel along the line's projection; residuals
are whitened by that, so such a point still binds the pose across the line. The focal
length has the lens as its prior, the pose has none.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ...core.cameras import Camera

_UNKNOWNS = 7
_ITERATIONS = 30
_CONVERGED = 1e-7  # metres, radians, share of the focal length
# Whitened residuals beyond this count linearly (Huber's 95 % efficiency in two dimensions).
_HUBER = 1.5
_BEHIND = 1e3  # the whitened residual of a point behind the camera


@dataclass(frozen=True)
class RefinedPose:
    """A refined camera and how certain it is.

    ``camera`` has the pose and the focal length; ``covariance`` (7, 7) float64 is that of
    its centre (metres), its rotation (rad, in the camera's frame) and the logarithm of its
    focal length; ``inliers`` (n,) bool.
    """

    camera: Camera
    covariance: np.ndarray
    inliers: np.ndarray

    @property
    def sigma_m(self) -> float:
        """Standard deviation of the centre along its least certain direction, metres."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[:3, :3])[-1]))

    @property
    def sigma_deg(self) -> float:
        """Standard deviation of the rotation about its least certain axis, degrees."""
        return float(np.degrees(np.sqrt(np.linalg.eigvalsh(self.covariance[3:6, 3:6])[-1])))


def refine_pose(
    start: Camera,
    pixels: np.ndarray,
    points: np.ndarray,
    spreads: np.ndarray,
    sigma_px: float,
    max_error_px: float,
    focal_px: float,
    focal_sigma: float,
    cell_px: float,
) -> RefinedPose | None:
    """Refine ``start`` on ``pixels`` (n, 2) of the world's ``points`` (n, 3).

    ``spreads`` (n, 3) metres: one standard deviation of each point along the line it may
    lie on. ``sigma_px`` is a match's own error; a match that is off by more than
    ``max_error_px``, less what its point's own error explains, is an outlier.
    ``focal_px`` is the focal length expected beforehand and ``focal_sigma`` its relative
    uncertainty. Errors within ``cell_px`` of each other are one error, the surface's, so a
    thousand matches on one object are no better than one. None when the matches do not
    determine the pose.
    """
    camera, zoom = start, np.log(start.fx / focal_px)
    whitener = _whitener(start, points, spreads, sigma_px)
    prior = np.zeros((_UNKNOWNS, _UNKNOWNS))
    prior[6, 6] = focal_sigma**-2
    for _ in range(_ITERATIONS):
        off, jacobian = _linearised(camera, pixels, points, whitener)
        weight = 1.0 / np.maximum(1.0, np.linalg.norm(off, axis=1) / _HUBER)
        normal = np.einsum("n,nij,nik->jk", weight, jacobian, jacobian) + prior
        slope = np.einsum("n,nij,ni->j", weight, jacobian, off) + prior[:, 6] * zoom
        try:
            step = -np.linalg.solve(normal, slope)
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(step).all() or np.abs(step[3:]).max() > 1.0:
            return None
        camera, zoom = _moved(camera, step), zoom + step[6]
        if np.abs(step).max() < _CONVERGED:
            break
    off, jacobian = _linearised(camera, pixels, points, whitener)
    length = np.linalg.norm(off, axis=1)
    inliers = length <= max_error_px / sigma_px
    if inliers.sum() < _UNKNOWNS:
        return None
    weight = 1.0 / np.maximum(1.0, length[inliers] / _HUBER)
    normal = np.einsum("n,nij,nik->jk", weight, jacobian[inliers], jacobian[inliers])
    cells = np.unique(np.floor(pixels[inliers] / cell_px), axis=0)
    variance = max(1.0, float(np.mean(weight * length[inliers] ** 2)) / 2.0) * inliers.sum() / len(cells)
    try:
        covariance = np.linalg.inv(normal / variance + prior)
    except np.linalg.LinAlgError:
        return None
    if not np.isfinite(covariance).all() or covariance.diagonal().min() <= 0.0:
        return None
    return RefinedPose(camera, covariance, inliers)


def _moved(camera: Camera, step: np.ndarray) -> Camera:
    pose = camera.world_from_camera.copy()
    pose[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec(step[3:6]).as_matrix()
    pose[:3, 3] += step[:3]
    zoom = np.exp(step[6])
    return replace(camera, fx=camera.fx * zoom, fy=camera.fy * zoom, world_from_camera=pose)


def _linearised(
    camera: Camera, pixels: np.ndarray, points: np.ndarray, whitener: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Whitened residuals (n, 2) and their derivatives (n, 2, 7); those of points behind are 0."""
    world_to_camera = camera.world_from_camera[:3, :3].T
    local = (points - camera.centre) @ world_to_camera.T
    before = local[:, 2] > 1e-6
    x, y, z = np.where(before[:, None], local, [0.0, 0.0, 1.0]).T
    none = np.zeros_like(x)
    of_local = np.stack(
        [
            np.stack([camera.fx / z, none, -camera.fx * x / z**2], axis=-1),
            np.stack([none, camera.fy / z, -camera.fy * y / z**2], axis=-1),
        ],
        axis=1,
    )
    # The point moves against the camera: by -R^T d when its centre moves by d, by p x w when it turns by w.
    turning = np.stack(
        [np.stack([none, -z, y], axis=-1), np.stack([z, none, -x], axis=-1), np.stack([-y, x, none], axis=-1)], axis=1
    )
    seen = np.stack([camera.fx * x / z, camera.fy * y / z], axis=-1)
    centre = np.array([camera.cx, camera.cy])
    jacobian = np.concatenate([of_local @ -world_to_camera, of_local @ turning, seen[..., None]], axis=2)
    off = np.einsum("nij,nj->ni", whitener, seen + centre - pixels)
    off[~before] = _BEHIND
    jacobian[~before] = 0.0
    return off, whitener @ jacobian


def _whitener(camera: Camera, points: np.ndarray, spreads: np.ndarray, sigma_px: float) -> np.ndarray:
    """(n, 2, 2): takes pixel errors to standard deviations of the match and of its point."""
    blur = (camera.project(points + spreads)[0] - camera.project(points - spreads)[0]) / 2.0
    length = np.linalg.norm(blur, axis=1, keepdims=True)
    along = np.where(length > 1e-9, blur / np.maximum(length, 1e-9), [1.0, 0.0])
    shrink = 1.0 / sigma_px - 1.0 / np.hypot(sigma_px, length[..., None])
    return np.eye(2) / sigma_px - shrink * along[:, :, None] * along[:, None, :]

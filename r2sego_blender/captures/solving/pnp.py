"""The pose of a calibrated camera from pixels matched to world points (LO-RANSAC PnP)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...core.cameras import Camera
from ..colmap import load_pycolmap

_MIN_POINTS = 4
_MAX_TRIALS = 20_000


@dataclass(frozen=True)
class PoseEstimate:
    """An estimated pose: ``camera`` at it, ``inliers`` (n,) bool, ``error_px`` RMS of the inliers."""

    camera: Camera
    inliers: np.ndarray
    error_px: float

    @property
    def inlier_count(self) -> int:
        """How many of the matches agree with the pose."""
        return int(self.inliers.sum())


def estimate_pose(
    points_px: np.ndarray, points_world: np.ndarray, camera: Camera, max_error_px: float, seed: int
) -> PoseEstimate | None:
    """The pose at which ``camera`` sees world points at the given pixels, or None.

    ``points_px`` is (n, 2), pixel centres at half-integers, ``points_world`` (n, 3) in
    metres; matches may be wrong, those off by more than ``max_error_px`` are left out.
    Only the lens of ``camera`` is used, never its pose. The same seed gives the same pose.
    None when fewer than four finite matches are given or no pose is found.
    """
    pycolmap = load_pycolmap()
    pixels = np.asarray(points_px, np.float64).reshape(-1, 2)
    points = np.asarray(points_world, np.float64).reshape(-1, 3)
    if len(pixels) != len(points):
        raise ValueError(f"{len(pixels)} pixels but {len(points)} world points")
    finite = np.isfinite(pixels).all(axis=1) & np.isfinite(points).all(axis=1)
    if finite.sum() < _MIN_POINTS:
        return None
    lens = pycolmap.Camera(
        model="PINHOLE", width=camera.width, height=camera.height, params=[camera.fx, camera.fy, camera.cx, camera.cy]
    )
    options = pycolmap.AbsolutePoseEstimationOptions()
    options.ransac.max_error = float(max_error_px)
    options.ransac.max_num_trials = _MAX_TRIALS
    options.ransac.random_seed = int(seed)
    options.ransac.num_threads = 1
    found = pycolmap.estimate_and_refine_absolute_pose(pixels[finite], points[finite], lens, options)
    if found is None:
        return None
    camera_from_world = np.eye(4)
    camera_from_world[:3] = found["cam_from_world"].matrix()
    if not np.isfinite(camera_from_world).all():
        return None
    solved = camera.at(_inverse_rigid(camera_from_world))
    inliers = np.zeros(len(pixels), bool)
    inliers[finite] = np.asarray(found["inlier_mask"], bool).ravel()
    if inliers.sum() < _MIN_POINTS:
        return None
    projected, _ = solved.project(points[inliers])
    error_px = float(np.sqrt(np.mean(np.sum((projected - pixels[inliers]) ** 2, axis=1))))
    return PoseEstimate(solved, inliers, error_px)


def _inverse_rigid(transform: np.ndarray) -> np.ndarray:
    inverse = np.eye(4)
    inverse[:3, :3] = transform[:3, :3].T
    inverse[:3, 3] = -transform[:3, :3].T @ transform[:3, 3]
    return inverse

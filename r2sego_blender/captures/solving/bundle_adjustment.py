"""Bundle adjustment of poses that are nearly right: their priors hold what the tracks leave open.

Levenberg-Marquardt on reprojection errors (Triggs et al., "Bundle Adjustment - A Modern
Synthesis", 2000, Sec. 6: the points are eliminated by their Schur complement), with Cauchy's
loss against wrong matches. COLMAP's has priors of positions alone, and takes the frame and the
scale from them: photographs taken along a line, or one without tracks, would turn freely.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.linalg
import scipy.sparse
from scipy.spatial.transform import Rotation

from ...core.cameras import Camera

# Cauchy's loss is solved for at a width in which the errors of wrong poses are none, then at
# that of the keypoints' own errors.
_LOSS_WIDTHS_PX = (4.0, 0.5)
_MAX_STEPS = 50
# Poses have come to rest when a step moves none by this many of its standard deviations.
_AT_REST = 1e-3
_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-6, 1e-12, 1e8
# Share of the usual distance below which nothing is divided by a depth.
_NEAREST_SHARE = 1e-3


class Tracks(NamedTuple):
    """Measurements of points, those of the first camera first.

    ``camera`` and ``point`` (m,) int64 say whose and of what each is, ``pixels`` (m, 2)
    float64 where.
    """

    camera: np.ndarray
    point: np.ndarray
    pixels: np.ndarray

    @staticmethod
    def of(pixels: np.ndarray) -> Tracks:
        """The tracks of ``pixels`` (P, N, 2), NaN where a camera has not measured a point."""
        camera, point = np.nonzero(np.isfinite(pixels[..., 0]).T)
        return Tracks(camera, point, pixels[point, camera].astype(np.float64))


def adjusted(
    cameras: Sequence[Camera], points: np.ndarray, pixels: np.ndarray, centre_sigma: float, rotation_sigma_rad: float
) -> tuple[tuple[Camera, ...], np.ndarray]:
    """The cameras and points (P, 3) that fit the tracks and the cameras' given poses best.

    ``pixels`` (P, N, 2) are the measurements, NaN where there is none. The sigmas are the
    standard deviations of the given poses along and about each axis, ``centre_sigma`` in
    their unit; a keypoint's is a pixel. Lenses stay as they are.

    The tracks say nothing of where the whole lies, how it is turned and how large it is: there
    the priors alone decide, so that the given poses' frame and scale are kept in the sense
    of least squares. A camera without tracks stays where it is.
    """
    tracks = Tracks.of(pixels)
    sigma = np.repeat([centre_sigma, rotation_sigma_rad], 3)
    state = _State(
        np.stack([c.world_from_camera[:3, :3] for c in cameras]),
        np.stack([c.centre for c in cameras]),
        np.asarray(points, np.float64),
    )
    problem = _Problem(cameras, tracks, state, sigma)
    for width_px in _LOSS_WIDTHS_PX:
        state = _minimised(problem, state, width_px)
    poses = np.tile(np.eye(4), (len(cameras), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = state.rotations, state.centres
    return tuple(c.at(pose) for c, pose in zip(cameras, poses, strict=True)), state.points


def reprojection_errors(cameras: Sequence[Camera], points: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """(m,) pixels from each measurement in ``pixels`` (P, N, 2) to its point's projection."""
    seen = np.isfinite(pixels[..., 0])
    errors = []
    for index, camera in enumerate(cameras):
        rows = seen[:, index]
        projected, _ = camera.project(points[rows])
        errors.append(np.linalg.norm(projected - pixels[rows, index], axis=1))
    return np.concatenate(errors)


class _State(NamedTuple):
    """Rotations (N, 3, 3) and centres (N, 3), world from camera, and points (P, 3)."""

    rotations: np.ndarray
    centres: np.ndarray
    points: np.ndarray

    def moved(self, poses: np.ndarray, points: np.ndarray) -> _State:
        """After steps (N, 6) of centres and rotations (about the world's axes) and of points."""
        turns = Rotation.from_rotvec(poses[:, 3:]).as_matrix()
        return _State(turns @ self.rotations, self.centres + poses[:, :3], self.points + points)


class _Problem:
    """What does not change while it is solved."""

    def __init__(self, cameras: Sequence[Camera], tracks: Tracks, given: _State, sigma: np.ndarray) -> None:
        self.tracks, self.given, self.sigma = tracks, given, sigma
        self.focal = np.array([[c.fx, c.fy] for c in cameras])[tracks.camera]
        self.principal = np.array([[c.cx, c.cy] for c in cameras])[tracks.camera]
        distances = np.linalg.norm(given.points[tracks.point] - given.centres[tracks.camera], axis=1)
        self.nearest = _NEAREST_SHARE * np.median(distances)
        count = len(tracks.camera)
        ones, order = np.ones(count), np.arange(count)
        self.of_cameras = scipy.sparse.csr_array((ones, (tracks.camera, order)), (len(cameras), count))
        self.of_points = scipy.sparse.csr_array((ones, (tracks.point, order)), (len(given.points), count))

    def local(self, state: _State) -> tuple[np.ndarray, np.ndarray]:
        """Points in their cameras (m, 3) and rotations (m, 3, 3).

        What lies behind a camera is put close before it, where its error is large.
        """
        rotations = state.rotations[self.tracks.camera]
        offset = state.points[self.tracks.point] - state.centres[self.tracks.camera]
        local = np.einsum("kij,ki->kj", rotations, offset)
        local[:, 2] = np.maximum(local[:, 2], self.nearest)
        return local, rotations

    def errors_px(self, local: np.ndarray) -> np.ndarray:
        """(m, 2) projections less measurements."""
        return local[:, :2] / local[:, 2:] * self.focal + self.principal - self.tracks.pixels

    def off_prior(self, state: _State) -> np.ndarray:
        """(N, 6) how far centres and rotations are from the given ones, in deviations."""
        turned = Rotation.from_matrix(state.rotations @ self.given.rotations.transpose(0, 2, 1))
        off = np.concatenate([state.centres - self.given.centres, turned.as_rotvec()], axis=1)
        return off / self.sigma

    def cost(self, state: _State, width_px: float) -> float:
        squares = (self.errors_px(self.local(state)[0]) ** 2).sum(axis=1)
        loss = width_px**2 * np.log1p(squares / width_px**2)
        return float(loss.sum() + (self.off_prior(state) ** 2).sum())


def _minimised(problem: _Problem, state: _State, width_px: float) -> _State:
    damping, cost = _DAMPING, problem.cost(state, width_px)
    for _ in range(_MAX_STEPS):
        system = _System(problem, state, width_px)
        while damping < _MOST_DAMPING:
            poses, points = system.step(damping)
            tried = state.moved(poses, points)
            tried_cost = problem.cost(tried, width_px)
            if tried_cost <= cost:
                break
            damping *= 10.0
        else:
            return state
        state, cost = tried, tried_cost
        if damping == _LEAST_DAMPING and np.abs(poses / problem.sigma).max() < _AT_REST:
            return state
        damping = max(damping / 100.0, _LEAST_DAMPING)
    return state


class _System:
    """The normal equations at a state, weighted by the loss; their blocks are summed as they lie."""

    def __init__(self, problem: _Problem, state: _State, width_px: float) -> None:
        local, rotations = problem.local(state)
        errors = problem.errors_px(local)
        weight = 1.0 / (1.0 + (errors**2).sum(axis=1) / width_px**2)
        # d pixels / d local, (m, 2, 3)
        slope = np.zeros((len(local), 2, 3))
        slope[:, (0, 1), (0, 1)] = problem.focal / local[:, 2:]
        slope[:, :, 2] = -problem.focal * local[:, :2] / local[:, 2:] ** 2
        by_point = slope @ rotations.transpose(0, 2, 1)
        offset = state.points[problem.tracks.point] - state.centres[problem.tracks.camera]
        by_pose = np.concatenate([-by_point, np.cross(by_point, offset[:, None, :])], axis=2)
        weighed_pose = by_pose * weight[:, None, None]
        weighed_point = by_point * weight[:, None, None]

        cameras, points = len(state.centres), len(state.points)
        self.tracks = problem.tracks
        self.of_points = problem.of_points
        self.poses = _summed(problem.of_cameras, weighed_pose.transpose(0, 2, 1) @ by_pose)
        self.poses[:, range(6), range(6)] += problem.sigma**-2.0
        self.points = _summed(problem.of_points, weighed_point.transpose(0, 2, 1) @ by_point)
        self.mixed = weighed_pose.transpose(0, 2, 1) @ by_point
        slope_of_poses = np.einsum("kij,ki->kj", weighed_pose, errors)
        slope_of_points = np.einsum("kij,ki->kj", weighed_point, errors)
        self.pose_slope = problem.of_cameras @ slope_of_poses
        self.pose_slope += problem.off_prior(state) / problem.sigma
        self.point_slope = problem.of_points @ slope_of_points
        self.starts = np.concatenate([[0], np.cumsum(np.bincount(self.tracks.camera, minlength=cameras))])
        self.shape = 6 * cameras, 3 * points

    def step(self, damping: float) -> tuple[np.ndarray, np.ndarray]:
        """Steps of poses (N, 6) and points (P, 3) that minimise the damped quadratic model."""
        inverse = np.linalg.inv(_damped(self.points, damping))
        reduced = self.mixed @ inverse[self.tracks.point]
        mixed, eliminated = self._blocks(self.mixed), self._blocks(reduced)
        schur = scipy.linalg.block_diag(*_damped(self.poses, damping)) - (eliminated @ mixed.T).toarray()
        slope = self.pose_slope.ravel() - eliminated @ self.point_slope.ravel()
        poses = -scipy.linalg.solve(schur, slope, assume_a="sym")
        rest = self.point_slope + (mixed.T @ poses).reshape(-1, 3)
        return poses.reshape(-1, 6), -np.einsum("kij,kj->ki", inverse, rest)

    def _blocks(self, values: np.ndarray) -> scipy.sparse.bsr_array:
        """Blocks (m, 6, 3) of cameras and points as a sparse matrix."""
        return scipy.sparse.bsr_array((values, self.tracks.point, self.starts), shape=self.shape)


def _damped(blocks: np.ndarray, damping: float) -> np.ndarray:
    """The blocks (n, k, k) with their diagonals enlarged; those of points at infinity stay regular."""
    diagonal = np.einsum("kii->ki", blocks)
    floor = 1e-12 * diagonal.max(axis=1, keepdims=True) + 1e-12
    return blocks + (damping * diagonal + floor)[:, :, None] * np.eye(blocks.shape[1])


def _summed(owners: scipy.sparse.csr_array, values: np.ndarray) -> np.ndarray:
    """The sums over each owner's measurements of ``values`` (m, ...)."""
    return (owners @ values.reshape(len(values), -1)).reshape(-1, *values.shape[1:])

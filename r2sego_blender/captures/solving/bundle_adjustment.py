"""Bundle adjustment of poses that are nearly right, and of lenses: priors hold what the tracks leave open.

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
# With free lenses the errors of wrong ones are those of tens of pixels first.
_LENS_WIDTHS_PX = (16.0, *_LOSS_WIDTHS_PX)
LENS_TERMS = 5
"""Of a lens's correction: the logarithm of the focal length's factor, the principal point's shift along
x and y in focal lengths, and the radial coefficients k1 and k2 beyond the lens as it is."""
# Radial terms grow no further beyond this many times the squared radius of a picture's corners: points that
# for now lie beside a camera would tell the lens.
_BEYOND_CORNERS = 2.0
# Standard deviations of these, wide: they hold what no track tells alone.
_LENS_SIGMA = np.array([0.3, 0.1, 0.1, 0.3, 0.3])


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
    cameras: Sequence[Camera],
    points: np.ndarray,
    pixels: np.ndarray,
    centre_sigma: float | np.ndarray,
    rotation_sigma_rad: float | np.ndarray,
) -> tuple[tuple[Camera, ...], np.ndarray]:
    """The cameras and points (P, 3) that fit the tracks and the cameras' given poses best.

    ``pixels`` (P, N, 2) are the measurements, NaN where there is none. The sigmas are the
    standard deviations of the given poses along and about each axis, of all or (N,) of each, ``centre_sigma`` in
    their unit; a keypoint's is a pixel. Lenses stay as they are.

    The tracks say nothing of where the whole lies, how it is turned and how large it is: there
    the priors alone decide, so that the given poses' frame and scale are kept in the sense
    of least squares. A camera without tracks stays where it is.
    """
    state = _given(cameras, points, np.zeros((1, LENS_TERMS)))
    sigma = np.repeat(np.stack([centre_sigma, rotation_sigma_rad], axis=-1), 3, axis=-1)
    problem = _Problem(cameras, Tracks.of(pixels), state, sigma)
    for width_px in _LOSS_WIDTHS_PX:
        state = _minimised(problem, state, width_px)
    return _at(cameras, state), state.points


class AdjustedLenses(NamedTuple):
    """Cameras with their poses adjusted and their lenses as given, points (P, 3), and what corrects the lenses.

    ``terms`` and ``sigma`` (G, LENS_TERMS) float64 are each group's correction and its standard
    deviations, where a keypoint's is a pixel; both are 0 where a term was not free, and infinite deviations say
    that rounding left nothing known of a term. ``errors_px`` (m,) are the tracks' reprojection errors under it.
    """

    cameras: tuple[Camera, ...]
    points: np.ndarray
    terms: np.ndarray
    sigma: np.ndarray
    errors_px: np.ndarray


def adjusted_lenses(
    cameras: Sequence[Camera],
    points: np.ndarray,
    pixels: np.ndarray,
    centre_sigma: float,
    rotation_sigma_rad: float,
    group: np.ndarray,
    free: np.ndarray,
    terms: np.ndarray,
) -> AdjustedLenses:
    """As ``adjusted``, with the terms of lenses that are ``free`` (G, LENS_TERMS) bool.

    ``group`` (N,) int64 says whose lens each camera has, ``terms`` (G, LENS_TERMS) where the search begins.
    """
    state = _given(cameras, points, np.where(free, terms, 0.0))
    sigma = np.repeat([centre_sigma, rotation_sigma_rad], 3)
    problem = _Problem(cameras, Tracks.of(pixels), state, sigma, _FreeLenses(group, free))
    for width_px in _LENS_WIDTHS_PX:
        state = _minimised(problem, state, width_px)
    spread = np.zeros(free.shape)
    if free.any():
        variance = _System(problem, state, width_px).covariance().diagonal()[6 * len(cameras) :]
        spread[free] = np.sqrt(np.where(variance >= 0.0, variance, np.inf))
    errors_px = np.linalg.norm(problem.errors_px(problem.local(state)[0], state), axis=1)
    return AdjustedLenses(_at(cameras, state), state.points, state.lenses, spread, errors_px)


def _given(cameras: Sequence[Camera], points: np.ndarray, lenses: np.ndarray) -> _State:
    return _State(
        np.stack([c.world_from_camera[:3, :3] for c in cameras]),
        np.stack([c.centre for c in cameras]),
        np.asarray(points, np.float64),
        lenses,
    )


def _at(cameras: Sequence[Camera], state: _State) -> tuple[Camera, ...]:
    poses = np.tile(np.eye(4), (len(cameras), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = state.rotations, state.centres
    return tuple(c.at(pose) for c, pose in zip(cameras, poses, strict=True))


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
    """Rotations (N, 3, 3) and centres (N, 3), world from camera, points (P, 3), and lenses (G, LENS_TERMS)."""

    rotations: np.ndarray
    centres: np.ndarray
    points: np.ndarray
    lenses: np.ndarray

    def moved(self, step: _Step) -> _State:
        """After steps of centres and rotations (about the world's axes), of points and of lenses."""
        turns = Rotation.from_rotvec(step.poses[:, 3:]).as_matrix()
        return _State(
            turns @ self.rotations,
            self.centres + step.poses[:, :3],
            self.points + step.points,
            self.lenses + step.lenses,
        )


class _Step(NamedTuple):
    """Of poses (N, 6), points (P, 3) and lenses (G, LENS_TERMS)."""

    poses: np.ndarray
    points: np.ndarray
    lenses: np.ndarray


class _FreeLenses(NamedTuple):
    """``group`` (N,) int64: whose lens each camera has; ``free`` (G, LENS_TERMS) bool: which of its terms are."""

    group: np.ndarray
    free: np.ndarray


class _Problem:
    """What does not change while it is solved. Without ``lenses`` these stay as they are."""

    def __init__(
        self,
        cameras: Sequence[Camera],
        tracks: Tracks,
        given: _State,
        sigma: np.ndarray,
        lenses: _FreeLenses | None = None,
    ) -> None:
        self.tracks, self.given, self.sigma = tracks, given, sigma
        self.focal = np.array([[c.fx, c.fy] for c in cameras])[tracks.camera]
        self.principal = np.array([[c.cx, c.cy] for c in cameras])[tracks.camera]
        distances = np.linalg.norm(given.points[tracks.point] - given.centres[tracks.camera], axis=1)
        self.nearest = _NEAREST_SHARE * np.median(distances)
        count = len(tracks.camera)
        ones, order = np.ones(count), np.arange(count)
        self.of_cameras = scipy.sparse.csr_array((ones, (tracks.camera, order)), (len(cameras), count))
        self.of_points = scipy.sparse.csr_array((ones, (tracks.point, order)), (len(given.points), count))
        self.lenses = lenses
        corners = np.array([[max(c.cx, c.width - c.cx) / c.fx, max(c.cy, c.height - c.cy) / c.fy] for c in cameras])
        self.outermost = _BEYOND_CORNERS * (corners**2).sum(axis=1)[tracks.camera][:, None]

    def local(self, state: _State) -> tuple[np.ndarray, np.ndarray]:
        """Points in their cameras (m, 3) and rotations (m, 3, 3).

        What lies behind a camera is put close before it, where its error is large.
        """
        rotations = state.rotations[self.tracks.camera]
        offset = state.points[self.tracks.point] - state.centres[self.tracks.camera]
        local = np.einsum("kij,ki->kj", rotations, offset)
        local[:, 2] = np.maximum(local[:, 2], self.nearest)
        return local, rotations

    def errors_px(self, local: np.ndarray, state: _State) -> np.ndarray:
        """(m, 2) projections less measurements."""
        if self.lenses is None:
            return local[:, :2] / local[:, 2:] * self.focal + self.principal - self.tracks.pixels
        seen = _Seen(self, self.lenses, local, state)
        centre = self.principal + self.focal * seen.lens[:, 1:3]
        return seen.zoomed * seen.rays * seen.radial + centre - self.tracks.pixels

    def slopes(self, local: np.ndarray, state: _State) -> tuple[np.ndarray, np.ndarray | None]:
        """Derivatives of pixels: (m, 2, 3) by local points, and (m, 2, LENS_TERMS) by lenses where any is free."""
        slope = np.zeros((len(local), 2, 3))
        if self.lenses is None:
            slope[:, (0, 1), (0, 1)] = self.focal / local[:, 2:]
            slope[:, :, 2] = -self.focal * local[:, :2] / local[:, 2:] ** 2
            return slope, None
        seen = _Seen(self, self.lenses, local, state)
        squares = seen.squares
        bent = (2.0 * seen.lens[:, 3:4] + 4.0 * seen.lens[:, 4:5] * squares) * seen.rays * seen.inside
        by_ray = seen.rays[:, :, None] * bent[:, None, :]
        by_ray[:, (0, 1), (0, 1)] += seen.radial
        by_ray *= seen.zoomed[:, :, None]
        slope[:, :, :2] = by_ray / local[:, 2:, None]
        slope[:, :, 2] = -np.einsum("kij,kj->ki", by_ray, seen.rays) / local[:, 2:]
        by_lens = np.zeros((len(local), 2, LENS_TERMS))
        by_lens[:, :, 0] = seen.zoomed * seen.rays * seen.radial
        by_lens[:, (0, 1), (1, 2)] = self.focal
        by_lens[:, :, 3] = seen.zoomed * seen.rays * squares
        by_lens[:, :, 4] = by_lens[:, :, 3] * squares
        return slope, by_lens

    def off_prior(self, state: _State) -> np.ndarray:
        """(N, 6) how far centres and rotations are from the given ones, in deviations."""
        turned = Rotation.from_matrix(state.rotations @ self.given.rotations.transpose(0, 2, 1))
        off = np.concatenate([state.centres - self.given.centres, turned.as_rotvec()], axis=1)
        return off / self.sigma

    def cost(self, state: _State, width_px: float) -> float:
        squares = (self.errors_px(self.local(state)[0], state) ** 2).sum(axis=1)
        loss = width_px**2 * np.log1p(squares / width_px**2)
        cost = float(loss.sum() + (self.off_prior(state) ** 2).sum())
        return cost if self.lenses is None else cost + float(((state.lenses / _LENS_SIGMA) ** 2).sum())


class _Seen:
    """Measurements through lenses that are being corrected: rays (m, 2) and what becomes of them."""

    def __init__(self, problem: _Problem, lenses: _FreeLenses, local: np.ndarray, state: _State) -> None:
        self.lens = state.lenses[lenses.group[problem.tracks.camera]]
        self.rays = local[:, :2] / local[:, 2:]
        squares = (self.rays**2).sum(axis=1, keepdims=True)
        self.squares = np.minimum(squares, problem.outermost)
        self.inside = squares < problem.outermost
        self.radial = 1.0 + self.squares * (self.lens[:, 3:4] + self.squares * self.lens[:, 4:5])
        self.zoomed = problem.focal * np.exp(self.lens[:, :1])


def _minimised(problem: _Problem, state: _State, width_px: float) -> _State:
    damping, cost = _DAMPING, problem.cost(state, width_px)
    for _ in range(_MAX_STEPS):
        system = _System(problem, state, width_px)
        while damping < _MOST_DAMPING:
            step = system.step(damping)
            tried = state.moved(step)
            tried_cost = problem.cost(tried, width_px)
            if tried_cost <= cost:
                break
            damping *= 10.0
        else:
            return state
        state, cost = tried, tried_cost
        at_rest = np.abs(step.poses / problem.sigma).max() < _AT_REST and np.abs(step.lenses).max() < _AT_REST
        if damping == _LEAST_DAMPING and at_rest:
            return state
        damping = max(damping / 100.0, _LEAST_DAMPING)
    return state


class _System:
    """The normal equations at a state, weighted by the loss; their blocks are summed as they lie."""

    def __init__(self, problem: _Problem, state: _State, width_px: float) -> None:
        local, rotations = problem.local(state)
        errors = problem.errors_px(local, state)
        weight = 1.0 / (1.0 + (errors**2).sum(axis=1) / width_px**2)
        slope, by_lens = problem.slopes(local, state)
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
        self.lens_shape = state.lenses.shape
        self.lenses: _LensRows | None = None
        if by_lens is not None and problem.lenses is not None:
            weighed_lens = (by_lens * weight[:, None, None]).transpose(0, 2, 1)
            self.lenses = _LensRows(
                problem, problem.lenses, state, by_lens, weighed_lens, weighed_pose, by_point, errors
            )

    def step(self, damping: float) -> _Step:
        """The steps that minimise the damped quadratic model."""
        inverse = np.linalg.inv(_damped(self.points, damping))
        mixed, schur, slope = self._reduced(damping, inverse)
        found = -scipy.linalg.solve(schur, slope, assume_a="sym")
        poses, lenses = found[: self.shape[0]], np.zeros(self.lens_shape)
        rest = self.point_slope + (mixed.T @ poses).reshape(-1, 3)
        if self.lenses is not None:
            lenses[self.lenses.free] = found[self.shape[0] :]
            rest += np.tensordot(found[self.shape[0] :], self.lenses.by_points, 1)
        return _Step(poses.reshape(-1, 6), -np.einsum("kij,kj->ki", inverse, rest), lenses)

    def covariance(self) -> np.ndarray:
        """Of poses and the free terms of lenses."""
        return np.linalg.inv(self._reduced(0.0, np.linalg.inv(_damped(self.points, 0.0)))[1])

    def _reduced(self, damping: float, inverse: np.ndarray) -> tuple[scipy.sparse.bsr_array, np.ndarray, np.ndarray]:
        """Blocks of poses and points, and the Schur complement and slope once points are eliminated."""
        mixed, eliminated = self._blocks(self.mixed), self._blocks(self.mixed @ inverse[self.tracks.point])
        schur = scipy.linalg.block_diag(*_damped(self.poses, damping)) - (eliminated @ mixed.T).toarray()
        slope = self.pose_slope.ravel() - eliminated @ self.point_slope.ravel()
        if self.lenses is None:
            return mixed, schur, slope
        rows = self.lenses.by_points.reshape(-1, self.shape[1])
        lens_eliminated = np.einsum("fki,kij->fkj", self.lenses.by_points, inverse).reshape(rows.shape)
        crossed = self.lenses.by_poses - (mixed @ lens_eliminated.T).T
        own = self.lenses.own + np.diag(damping * self.lenses.own.diagonal()) - lens_eliminated @ rows.T
        slope = np.concatenate([slope, self.lenses.slope - lens_eliminated @ self.point_slope.ravel()])
        return mixed, np.block([[schur, crossed.T], [crossed, own]]), slope

    def _blocks(self, values: np.ndarray) -> scipy.sparse.bsr_array:
        """Blocks (m, 6, 3) of cameras and points as a sparse matrix."""
        return scipy.sparse.bsr_array((values, self.tracks.point, self.starts), shape=self.shape)


class _LensRows:
    """The rows of the normal equations that the free terms of lenses have."""

    def __init__(
        self,
        problem: _Problem,
        lenses: _FreeLenses,
        state: _State,
        by_lens: np.ndarray,
        weighed_lens: np.ndarray,
        weighed_pose: np.ndarray,
        by_point: np.ndarray,
        errors: np.ndarray,
    ) -> None:
        self.free = lenses.free
        chosen = np.flatnonzero(self.free.ravel())
        count, terms = len(self.free), LENS_TERMS
        cameras, points = len(state.centres), len(state.points)
        of_groups = scipy.sparse.csr_array((np.ones(cameras), (lenses.group, np.arange(cameras))), (count, cameras))
        own = _summed(of_groups, _summed(problem.of_cameras, weighed_lens @ by_lens))
        own[:, range(terms), range(terms)] += _LENS_SIGMA**-2.0
        self.own = scipy.linalg.block_diag(*own)[np.ix_(chosen, chosen)]
        by_poses = np.zeros((count, terms, cameras, 6))
        shared = _summed(problem.of_cameras, weighed_pose.transpose(0, 2, 1) @ by_lens)
        by_poses[lenses.group, :, np.arange(cameras)] = shared.transpose(0, 2, 1)
        self.by_poses = by_poses.reshape(count * terms, -1)[chosen]
        slope = of_groups @ (problem.of_cameras @ np.einsum("kji,ki->kj", weighed_lens, errors))
        self.slope = (slope + state.lenses / _LENS_SIGMA**2).ravel()[chosen]
        # Each group's measurements of a point are summed: (free terms, P, 3).
        place = lenses.group[problem.tracks.camera] * points + problem.tracks.point
        summing = scipy.sparse.csr_array(
            (np.ones(len(place)), (place, np.arange(len(place)))), (count * points, len(place))
        )
        by_points = _summed(summing, weighed_lens @ by_point).reshape(count, points, terms, 3)
        self.by_points = by_points.transpose(0, 2, 1, 3).reshape(count * terms, points, 3)[chosen]


def _damped(blocks: np.ndarray, damping: float) -> np.ndarray:
    """The blocks (n, k, k) with their diagonals enlarged; those of points at infinity stay regular."""
    diagonal = np.einsum("kii->ki", blocks)
    floor = 1e-12 * diagonal.max(axis=1, keepdims=True) + 1e-12
    return blocks + (damping * diagonal + floor)[:, :, None] * np.eye(blocks.shape[1])


def _summed(owners: scipy.sparse.csr_array, values: np.ndarray) -> np.ndarray:
    """The sums over each owner's measurements of ``values`` (m, ...)."""
    return (owners @ values.reshape(len(values), -1)).reshape(-1, *values.shape[1:])

"""How a depth sensor stands to the camera beside it: the rigid and focal residual between the two.

Depth that an app calls aligned often is not: another lens, a baseline of centimetres. One small turn,
shift and ratio of focal lengths for all captures is estimated from what the photographs measured
without the sensor, their triangulated points, and from edges: a jump of depth is an edge of the picture.
It is taken only where both halves of the captures agree on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from ...core.cameras import Camera
from ...core.compiled import kernel
from ...core.images import resize
from ..capture import Capture
from ..sparse_points import SparsePoints
from .cleaning import SENSOR_SIGMA
from .sampling import smooth_pixels

_ALIGNED = np.zeros(7)  # a turn, a shift and the logarithm of the ratio of focal lengths
_PRIOR = np.repeat([np.radians(2.0), 0.05, 0.05], [3, 3, 1])
"""How far the two may stand from what is told of them, one sigma: a weak prior, where nothing else says anything."""

_STEPS = np.repeat([np.radians(0.2), 0.01, 0.01], [3, 3, 1])  # with which the search begins
_LARGEST_TURN_RAD, _TURN_STEP_RAD = np.radians(2.0), np.radians(0.4)
_MOST_TRIALS = 300
_UNKNOWN = 1.5  # sigmas that a point counts for where the map knows nothing

_FEATURE_SIGMA_PX = 0.7
_LEAST_SINE = 0.02  # of the angle under which a point was triangulated
_EDGE_SIGMA_PX = 1.5
_EDGE_REACH_PX = 6.0
_EDGE_JUMP = 0.08  # relative depth from which the nearer side of a jump is a silhouette
_MOST_EDGES = 400  # a capture
_MOST_POINTS = 600  # a capture
_MOST_SURFACE = 300  # a capture
_MOST_OTHERS = 4  # maps that each is compared with
_NEAREST_M = 0.1
_FEWEST_POINTS = 40
_FEWEST_CAPTURES = 4
_LEAST_MOVE = 0.7  # pixels of the map, or sigmas of its depth, that are worth a correction
_LEAST_GAIN = 0.03  # of the cost on the captures that the estimate was not made of


@dataclass(frozen=True)
class SensorPose:
    """``camera_from_sensor`` (4, 4) rigid, metres, and ``focal_ratio``: the sensor's focal length by the one
    that the photograph's camera would give it."""

    camera_from_sensor: np.ndarray
    focal_ratio: float = 1.0

    @staticmethod
    def aligned() -> SensorPose:
        """That of a sensor that sees exactly what the camera does."""
        return SensorPose(np.eye(4))

    @property
    def is_aligned(self) -> bool:
        """Whether nothing is to be corrected."""
        return self.focal_ratio == 1.0 and bool((self.camera_from_sensor == np.eye(4)).all())

    def __str__(self) -> str:
        turn_deg = np.degrees(Rotation.from_matrix(self.camera_from_sensor[:3, :3]).magnitude())
        shift_mm = 1000.0 * np.linalg.norm(self.camera_from_sensor[:3, 3])
        return f"turned by {turn_deg:.2f} degrees, {shift_mm:.0f} mm away, focal length {self.focal_ratio - 1.0:+.1%}"


def estimate_sensor_pose(
    captures: Sequence[Capture], sparse: SparsePoints, depths: Sequence[np.ndarray | None]
) -> SensorPose:
    """The pose of the sensor beside the camera, the same in all captures; aligned where nothing says otherwise.

    Captures and ``sparse`` are in metres; ``depths`` (h, w) float32 are what the sensor measured, straightened
    as the captures' cameras would see it were it aligned, None where there is none.
    """
    sines = sparse.widest_sine([capture.camera.centre for capture in captures])
    views = [
        _View.of(capture, index, sparse, sines, depth)
        for index, (capture, depth) in enumerate(zip(captures, depths, strict=True))
        if depth is not None
    ]
    views = [view for view in views if len(view.points) >= _FEWEST_POINTS]
    if len(views) < _FEWEST_CAPTURES:
        return SensorPose.aligned()
    halves = []
    for part, rest in ((views[::2], views[1::2]), (views[1::2], views[::2])):
        judge, found = _Evidence.of(rest), _Evidence.of(part).fitted()
        if not judge.cost(found) < (1.0 - _LEAST_GAIN) * judge.cost(_ALIGNED):
            return SensorPose.aligned()
        halves.append(_moved(views, found))
    found = _Evidence.of(views).fitted()
    moved = _moved(views, found)
    far = np.median(np.linalg.norm(moved, axis=1))
    apart = np.median(np.linalg.norm(halves[0] - halves[1], axis=1))
    return _pose(found) if far > max(_LEAST_MOVE, apart) else SensorPose.aligned()


def _moved(views: Sequence[_View], parameters: np.ndarray) -> np.ndarray:
    """(n, 3) how the parameters move what the maps show: pixels across and down, and depth in its sigmas.

    A turn, a shift and a lens look alike over one room: this alone is what they come to.
    """
    rotation, shift, ratio = _parts(parameters)
    moved = []
    for view in views:
        seen = (view.surface / [ratio, ratio, 1.0]) @ rotation.T + shift
        across = (seen[:, :2] / seen[:, 2:] - view.surface[:, :2] / view.surface[:, 2:]) * view.lens[:2]
        moved.append(np.column_stack([across, (seen[:, 2] / view.surface[:, 2] - 1.0) / SENSOR_SIGMA]))
    return np.concatenate(moved)


@dataclass(frozen=True)
class _View:
    """A capture with what judges its depth map, at the map's resolution: ``points`` (n, 3) in the camera's
    frame, with ``sigma`` (n,) the relative error of their depth; ``surface`` (k, 3) points of the sensor's
    frame that it measured, ``silhouettes`` (m, 3) those at the nearer side of jumps; ``edges`` (h, w), the
    distance in pixels to the photograph's edges."""

    camera: Camera
    depth: np.ndarray
    smooth: np.ndarray
    points: np.ndarray
    sigma: np.ndarray
    surface: np.ndarray
    silhouettes: np.ndarray
    edges: np.ndarray

    @staticmethod
    def of(capture: Capture, index: int, sparse: SparsePoints, sines: np.ndarray, depth: np.ndarray) -> _View:
        camera = capture.camera.fitted(max(depth.shape))
        depth = np.ascontiguousarray(depth, np.float32)
        smooth = smooth_pixels(depth)
        rows = np.flatnonzero(sparse.visibility[:, index] & (sines > _LEAST_SINE))
        local = sparse.points[rows] @ camera.camera_from_world[:3, :3].T + camera.camera_from_world[:3, 3]
        places, most = (np.argwhere(smooth), _silhouettes(depth)), (_MOST_SURFACE, _MOST_EDGES)
        surface, silhouettes = (
            camera_points(camera, depth, *one[:: max(1, len(one) // count)].T)
            for one, count in zip(places, most, strict=True)
        )
        grey = cv2.cvtColor(resize(capture.image(), camera.width, camera.height), cv2.COLOR_RGB2GRAY)
        found = cv2.Canny((255.0 * cv2.GaussianBlur(grey, (0, 0), 1.0)).astype(np.uint8), 30, 80)
        edges = cv2.distanceTransform(255 - found, cv2.DIST_L2, 5)
        view = _View(camera, depth, smooth, local, np.zeros(len(local)), surface, silhouettes, edges)
        known = np.flatnonzero(np.isfinite(view.off(local, _ALIGNED)))
        known = known[:: max(1, len(known) // _MOST_POINTS)]
        relative = _FEATURE_SIGMA_PX / (capture.camera.fx * sines[rows[known]])
        return replace(view, points=local[known], sigma=np.hypot(SENSOR_SIGMA, relative))

    def residuals(self, parameters: np.ndarray) -> np.ndarray:
        """What does not fit, in sigmas: the points' depth, then the silhouettes' distance to edges."""
        off = self.off(self.points, parameters) / self.sigma
        distance = np.empty(len(self.silhouettes))
        _edge_distances(self.silhouettes, *_parts(parameters), self.lens, self.edges, distance)
        return np.concatenate([off, distance / _EDGE_SIGMA_PX])

    def off(self, points: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """(n,) by what share of their depth points (n, 3) of the camera's frame lie behind the map's surface;
        NaN where it knows none."""
        share = np.empty(len(points))
        _behind(points, *_parts(parameters), self.lens, self.depth, self.smooth, share)
        return share

    def off_in(self, other: _View, parameters: np.ndarray) -> np.ndarray:
        """(k,) ``off`` of this map's own surface in another's."""
        rotation, shift, ratio = _parts(parameters)
        local = (self.surface / [ratio, ratio, 1.0]) @ rotation.T + shift
        to_other = other.camera.camera_from_world @ self.camera.world_from_camera
        return other.off(local @ to_other[:3, :3].T + to_other[:3, 3], parameters)

    @cached_property
    def lens(self) -> np.ndarray:
        """(4,) focal lengths and principal point."""
        return np.array([self.camera.fx, self.camera.fy, self.camera.cx, self.camera.cy])


@kernel
def _behind(points, rotation, shift, ratio, lens, depth, smooth, share):
    """``_View.off``: the depth between pixels is linear, and sure only on a smooth surface."""
    height, width = depth.shape
    for i in range(len(points)):
        share[i] = np.nan
        x, y, z = points[i, 0] - shift[0], points[i, 1] - shift[1], points[i, 2] - shift[2]
        ahead = rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z
        if ahead < _NEAREST_M:
            continue
        right = ratio * (rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z) / ahead
        down = ratio * (rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z) / ahead
        u, v = lens[0] * right + lens[2] - 0.5, lens[1] * down + lens[3] - 0.5
        if not (0.0 <= u < width - 1 and 0.0 <= v < height - 1) or not smooth[int(v + 0.5), int(u + 0.5)]:
            continue
        column, row = int(u), int(v)
        a, b = u - column, v - row
        above = (1.0 - a) * depth[row, column] + a * depth[row, column + 1]
        below = (1.0 - a) * depth[row + 1, column] + a * depth[row + 1, column + 1]
        share[i] = (ahead - ((1.0 - b) * above + b * below)) / ahead


@kernel
def _edge_distances(points, rotation, shift, ratio, lens, edges, distance):
    """How far the sensor's points (m, 3), seen from the camera, lie from an edge of the picture, in pixels."""
    height, width = edges.shape
    for i in range(len(points)):
        distance[i] = _EDGE_REACH_PX
        x, y, z = points[i, 0] / ratio, points[i, 1] / ratio, points[i, 2]
        ahead = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z + shift[2]
        if ahead < _NEAREST_M:
            continue
        right = (rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z + shift[0]) / ahead
        down = (rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z + shift[1]) / ahead
        u, v = lens[0] * right + lens[2] - 0.5, lens[1] * down + lens[3] - 0.5
        if not (0.0 <= u < width - 1 and 0.0 <= v < height - 1):
            continue
        column, row = int(u), int(v)
        a, b = u - column, v - row
        above = (1.0 - a) * edges[row, column] + a * edges[row, column + 1]
        below = (1.0 - a) * edges[row + 1, column] + a * edges[row + 1, column + 1]
        distance[i] = min((1.0 - b) * above + b * below, _EDGE_REACH_PX)


def camera_points(camera: Camera, depth: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """(n, 3) points of pixels of a depth map of ``camera``, in its own frame."""
    rays = [(column + 0.5 - camera.cx) / camera.fx, (row + 0.5 - camera.cy) / camera.fy, np.ones(len(row))]
    return np.stack(rays, axis=1) * depth[row, column, None]


def _silhouettes(depth: np.ndarray) -> np.ndarray:
    """(m, 2) rows and columns at the nearer side of a jump; what borders the unknown is none."""
    around = np.ones((3, 3), np.uint8)
    known = cv2.erode((depth > 0.0).astype(np.uint8), around) > 0
    farthest = cv2.dilate(depth, around)
    return np.argwhere(known & (farthest > (1.0 + _EDGE_JUMP) * depth))


@dataclass(frozen=True)
class _Evidence:
    """Captures, and the pairs of them whose maps show the same surfaces."""

    views: Sequence[_View]
    pairs: Sequence[tuple[_View, _View]]

    @staticmethod
    def of(views: Sequence[_View]) -> _Evidence:
        pairs = []
        for view in views:
            met = [np.isfinite(view.off_in(other, _ALIGNED)).sum() if other is not view else 0 for other in views]
            best = np.argsort(-np.array(met), kind="stable")[:_MOST_OTHERS]
            pairs += [(view, views[index]) for index in best if met[index] >= _FEWEST_POINTS]
        return _Evidence(views, pairs)

    def cost(self, parameters: np.ndarray) -> float:
        """What does not fit, robust (Cauchy's), and what is unlikely by itself."""
        off = [view.residuals(parameters) for view in self.views]
        off += [view.off_in(other, parameters) / (np.sqrt(2.0) * SENSOR_SIGMA) for view, other in self.pairs]
        every = np.concatenate(off)
        every[np.isnan(every)] = _UNKNOWN
        return float(np.log1p(every**2).sum()) + 0.5 * float(((parameters / _PRIOR) ** 2).sum())

    def fitted(self) -> np.ndarray:
        """The parameters (7,) that fit best: turns by steps, then all by a simplex.

        The cost is rough, of textures' edges and of points that come and go: derivatives lead nowhere.
        """
        turns = np.arange(-_LARGEST_TURN_RAD, _LARGEST_TURN_RAD + 1e-9, _TURN_STEP_RAD)
        starts = [np.array([x, y, 0.0, 0.0, 0.0, 0.0, 0.0]) for x in turns for y in turns]
        start = min(starts, key=self.cost)
        for _ in range(2):  # begun anew, a simplex leaves the ridge that it collapsed on
            simplex = np.vstack([start, start + np.diag(_STEPS)])
            options = {"initial_simplex": simplex, "maxfev": _MOST_TRIALS, "xatol": 1e-5, "fatol": 1e-3}
            start = minimize(self.cost, start, method="Nelder-Mead", options=options).x
        return start


def _parts(parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    return Rotation.from_rotvec(parameters[:3]).as_matrix(), parameters[3:6], float(np.exp(parameters[6]))


def _pose(parameters: np.ndarray) -> SensorPose:
    rotation, shift, ratio = _parts(parameters)
    camera_from_sensor = np.eye(4)
    camera_from_sensor[:3, :3], camera_from_sensor[:3, 3] = rotation, shift
    return SensorPose(camera_from_sensor, ratio)

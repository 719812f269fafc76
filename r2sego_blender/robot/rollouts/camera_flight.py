"""Cameras that fly freely: the paper's ablation without robot feasibility.

A flight is a camera-space trajectory through the free space that the geometry proxy knows,
as long, as fast and as often sampled as a rollout of the behaviour scope, but at any height
and with any gaze: no body has to reach it.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from ...core.cameras import look_at
from ...core.errors import RobotError
from ..planning.navigation import line_is_free
from ..scope.scope import BehaviourScope
from .rollout import Quality, Rollout

NAME = "camera_flight"
"""The behaviour, and the controller, of a flight."""

_VOXEL_M = 0.1
_CLEARANCE_M = 0.25
"""Kept from every surface of the proxy."""

_PITCH_DEG = (-20.0, 60.0)  # below the horizon
_GAZE_S = (1.0, 2.5)  # from one gaze to the next
_GOALS_TRIED, _STARTS_TRIED = 40, 20


class FreeSpace:
    """Where a camera can be: points away from all surfaces, in one piece with the captures."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, outline: np.ndarray, places: np.ndarray) -> None:
        """``vertices`` (V, 3) and ``faces`` (F, 3) are the proxy's, ``outline`` (n, 2) the
        polygon of the floor it may be above, and ``places`` (N, 3) the captures' centres;
        metres, in the world. Raises RobotError where nothing is free."""
        self._surface = cKDTree(_surface_points(vertices, faces))
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        low[:2], high[:2] = (np.maximum(low[:2], outline.min(axis=0)), np.minimum(high[:2], outline.max(axis=0)))
        counts = np.maximum(np.ceil((high - low) / _VOXEL_M), 1).astype(int)
        axes = [start + _VOXEL_M * (np.arange(n) + 0.5) for start, n in zip(low, counts, strict=True)]
        centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        free = _inside(outline, centres[..., :2]) & self.is_free(centres)
        pieces, number = ndimage.label(free)
        if not number:
            raise RobotError(
                "the proxy leaves no free space to fly in",
                where="robot proxy",
                cure="Use the robot's rollouts: selection.candidates=rollouts.",
            )
        labels = pieces[free]
        _, nearest = cKDTree(centres[free]).query(places)
        votes = np.bincount(labels[np.atleast_1d(nearest)])
        self.points = centres[pieces == votes.argmax()]

    def is_free(self, points: np.ndarray) -> np.ndarray:
        """(...,) bool: which points (..., 3) keep the clearance from every surface."""
        distance, _ = self._surface.query(points, distance_upper_bound=_CLEARANCE_M)
        return ~np.isfinite(distance)

    def sees(self, start: np.ndarray, goal: np.ndarray) -> bool:
        """Whether all points from ``start`` to ``goal`` are free."""
        return line_is_free(self.is_free, start, goal, _VOXEL_M)


def camera_flights(space: FreeSpace, scope: BehaviourScope, count: int, seed: int) -> tuple[Rollout, ...]:
    """``count`` flights with the scope's duration, camera rate and speeds, as rollouts that all
    succeed; without a body, ``qpos`` is (T, 0). The same seed gives the same bits."""
    return tuple(_flight(space, scope, (seed, number)) for number in range(count))


def _flight(space: FreeSpace, scope: BehaviourScope, key: tuple[int, int]) -> Rollout:
    rng = np.random.default_rng(key)
    frames = round(scope.episode.duration_s * scope.episode.camera_rate_hz) + 1
    times_s = np.arange(frames) / scope.episode.camera_rate_hz
    positions = _way(space, rng.uniform(*scope.walk_to.speed_m_s) * times_s, rng)
    yaw, pitch = _gazes(times_s, rng)
    ahead = np.stack([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), -np.sin(pitch)], axis=1)
    poses = np.stack([look_at(place, place + gaze) for place, gaze in zip(positions, ahead, strict=True)])
    pitch_deg, height_m = np.degrees(pitch), positions[:, 2]
    return Rollout(
        success=True,
        reason="",
        frame=frames - 1,
        qpos=np.empty((frames, 0)),
        times_s=times_s,
        camera_poses=poses,
        seed=key,
        behaviour=NAME,
        controller=NAME,
        quality=Quality(
            camera_height_m=(float(height_m.min()), float(height_m.max())),
            camera_pitch_deg=(float(pitch_deg.min()), float(pitch_deg.max())),
        ),
    )


def _way(space: FreeSpace, distances_m: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(T, 3) the places after ``distances_m`` on straight legs between free points.

    It starts where another point is in sight, and rests where there is none.
    """

    def drawn(count: int) -> np.ndarray:
        return space.points[rng.integers(len(space.points), size=count)]

    def goal_from(here: np.ndarray) -> np.ndarray | None:
        far = (goal for goal in drawn(_GOALS_TRIED) if math.dist(goal, here) > _VOXEL_M)
        return next((goal for goal in far if space.sees(here, goal)), None)

    starts = drawn(_STARTS_TRIED)
    corners = [next((start for start in starts if goal_from(start) is not None), starts[0])]
    flown = [0.0]
    while flown[-1] < distances_m[-1] and (goal := goal_from(corners[-1])) is not None:
        flown.append(flown[-1] + math.dist(goal, corners[-1]))
        corners.append(goal)
    return np.stack([np.interp(distances_m, flown, axis) for axis in np.transpose(corners)], axis=1)


def _gazes(times_s: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Yaw and downward pitch (T,) each, radians: from gaze to gaze, turning the shorter way."""
    at_s, yaws, pitches = [0.0], [rng.uniform(-math.pi, math.pi)], [rng.uniform(*_PITCH_DEG)]
    while at_s[-1] < times_s[-1]:
        at_s.append(at_s[-1] + rng.uniform(*_GAZE_S))
        yaws.append(rng.uniform(-math.pi, math.pi))
        pitches.append(rng.uniform(*_PITCH_DEG))
    return np.interp(times_s, at_s, np.unwrap(yaws)), np.radians(np.interp(times_s, at_s, pitches))


def _surface_points(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Points (P, 3) on all faces, half a voxel apart at most."""
    corners = np.asarray(vertices, np.float64)[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    parts = np.maximum(1, np.ceil(longest / (0.5 * _VOXEL_M))).astype(int)
    points = [np.asarray(vertices, np.float64)]
    for count in np.unique(parts[parts > 1]):
        a, b = np.divmod(np.arange((count + 1) ** 2), count + 1)
        weights = np.stack([a, b, count - a - b], axis=1)[a + b <= count] / count
        points.append(np.einsum("pk,fkc->fpc", weights, corners[parts == count]).reshape(-1, 3))
    return np.concatenate(points)


def _inside(outline: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(...,) bool: which points (..., 2) lie in the polygon: a ray from them crosses it once, or thrice."""
    x, y = points[..., 0], points[..., 1]
    inside = np.zeros(points.shape[:-1], bool)
    for (x0, y0), (x1, y1) in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        if y0 != y1:
            inside ^= ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) / (y1 - y0) * (x1 - x0))
    return inside

"""The floor of a room in its sparse points, and with it the direction of gravity."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...core.cameras import Camera

_MAX_TILT_DEG = 25.0
_TILT_SIGMA_DEG = 10.0
_PARALLEL_DEG = 4.0
# Share of the camera height within which planes may be one floor.
_SAME_FLOOR = 0.15
_SAMPLES = 8_000
_COMPARED_AT_ONCE = 1_000_000  # points times planes
_NEIGHBOURS = 24
_REFINED = 60
# Tolerances, as shares, of the successive fits: wide at first, then until nothing changes.
_REFINEMENT = (2.0, 1.5, 1.2) + 20 * (1.0,)
_SETTLED_AFTER = 20
_MIN_SUPPORT = 15
_MIN_SUPPORT_SHARE = 0.012
# Triangulation errors put some points below a floor; more than this means it is a table.
_MAX_BELOW_SHARE = 0.06
_MAX_BELOW_OF_SUPPORT = 0.6
_MIN_SHARE_OF_STRONGEST = 0.08
# Without a floor the lowest points tell its height, but not the very lowest: some are wrong.
_LOWEST_PERCENTILE = 2.0
_SLAB = 3.0

BY_DEVICE, AS_HELD = "upright as the device measured gravity", "upright as the cameras were held"
BY_LOWEST_POINTS = "height from the lowest points"
"""How up and the height of a ground without a floor were told, in words."""


@dataclass(frozen=True)
class Ground:
    """The plane ``normal . x = offset``, normal (3,) upwards; ``found`` False for a fallback.

    ``support`` points lie on it; ``description`` says in words how it was decided, and ``upright`` how up
    was told where no floor does.
    """

    normal: np.ndarray
    offset: float
    support: int
    found: bool
    description: str
    upright: str = ""

    @staticmethod
    def unseen(normal: np.ndarray, offset: float, upright: str, height: str) -> Ground:
        """One where no floor is seen; ``upright`` and ``height`` say in words what told both."""
        return Ground(normal, offset, 0, False, f"no floor seen: {upright}, {height}", upright)

    def height(self, points: np.ndarray) -> np.ndarray:
        """(...,) signed distances of points (..., 3) above the ground."""
        return np.asarray(points) @ self.normal - self.offset


def up_guess(cameras: Sequence[Camera]) -> np.ndarray:
    """(3,) float64: the likely direction up of cameras that are held level.

    The mean of the cameras' up directions, corrected towards being perpendicular to their
    x-axes, for cameras that all look down lean together but are seldom rolled.
    """
    x = np.array([camera.world_from_camera[:3, 0] for camera in cameras])
    mean = -np.mean([camera.world_from_camera[:3, 1] for camera in cameras], axis=0)
    mean /= max(np.linalg.norm(mean), 1e-12)
    # Least squares of x . up = 0, held at the mean where the headings do not vary.
    normal = x.T @ x / len(x) + 0.02 * np.eye(3)
    guess = np.linalg.solve(normal, 0.02 * mean)
    return guess / np.linalg.norm(guess)


def find_ground(
    points: np.ndarray, cameras: Sequence[Camera], tolerance: float, up: np.ndarray | None = None
) -> Ground:
    """The lowest well-supported plane, nearly level, below all cameras, with little under it.

    ``points`` (P, 3) and ``tolerance`` (how far floor points may lie off) share a unit.
    The densest level plane is often a table; a floor is told by having next to nothing
    below. Where no floor is seen, gravity comes from the largest level surface or the
    cameras, the height from the lowest points, and ``found`` is False. ``up`` (3,) is the
    direction up where it was measured; else it is guessed from the cameras. Deterministic.
    """
    points = np.asarray(points, np.float64)
    points = points[np.isfinite(points).all(axis=1)]
    measured = up is not None
    up = up / np.linalg.norm(up) if up is not None else up_guess(cameras)
    centres = np.array([camera.centre for camera in cameras])
    solid, level = [], up
    if len(points) >= _MIN_SUPPORT:
        needed = max(_MIN_SUPPORT, _MIN_SUPPORT_SHARE * len(points))
        sampled = _sampled_planes(points, up)
        planes = _best_planes(points, centres, *sampled, _contrast, tolerance, up, _MAX_TILT_DEG)
        planes = [plane for plane in planes if plane[2] >= needed]
        if planes:
            # The level surfaces of a room are parallel: the strongest one tells gravity, then
            # the floor is looked for among planes along it.
            level = max(planes, key=lambda plane: plane[2] * _plausibility(plane[0], up))[0]
            along = np.repeat(level[None], len(points), axis=0), points @ level
            planes += _best_planes(points, centres, *along, _contrast_of_parallels, tolerance, level, _PARALLEL_DEG)
            cos_parallel = np.cos(np.radians(_PARALLEL_DEG))
            planes = [plane for plane in planes if plane[0] @ level >= cos_parallel]
            strongest = max(plane[2] for plane in planes)
            needed = max(needed, _MIN_SHARE_OF_STRONGEST * strongest)
            solid = [plane for plane in planes if plane[2] >= needed]
    floors = [plane for plane in solid if _holds_the_room(points, plane, tolerance)]
    if floors:
        heights = np.array([(centres @ normal - offset).mean() for normal, offset, _ in floors])
        # Planes tilted a little through the same floor pass lower under the cameras: of the
        # lowest and those like it, the best supported one is the floor.
        alike = heights >= heights.max() * (1.0 - _SAME_FLOOR)
        normal, offset, _ = max((floors[i] for i in np.flatnonzero(alike)), key=lambda plane: plane[2])
        normal, offset = _settled(points, normal, offset, tolerance)
        support = int((np.abs(points @ normal - offset) <= tolerance).sum())
        return Ground(normal, offset, support, True, f"floor plane through {support} points")
    if measured:
        normal, how = up, BY_DEVICE
    elif solid:
        normal, how = level, "level with the largest surface"
    else:
        normal, how = up, AS_HELD
    offset = lowest(points if len(points) else centres, normal)
    return Ground.unseen(normal, offset, how, BY_LOWEST_POINTS)


def lowest(points: np.ndarray, up: np.ndarray) -> float:
    """The height along ``up`` below which next to none of ``points`` (P, 3) lie."""
    return float(np.percentile(points @ up, _LOWEST_PERCENTILE))


def _holds_the_room(points: np.ndarray, plane: tuple[np.ndarray, float, float], tolerance: float) -> bool:
    """Whether next to nothing lies below the plane."""
    heights = points @ plane[0] - plane[1]
    support = (np.abs(heights) <= tolerance).sum()
    below = (heights < -_SLAB * tolerance).sum()
    return bool(below <= min(_MAX_BELOW_SHARE * len(points), _MAX_BELOW_OF_SUPPORT * support))


def _best_planes(
    points: np.ndarray,
    centres: np.ndarray,
    normals: np.ndarray,
    offsets: np.ndarray,
    contrast_of: Callable[[np.ndarray, np.ndarray, np.ndarray, float], np.ndarray],
    tolerance: float,
    up: np.ndarray,
    max_tilt_deg: float,
) -> list[tuple[np.ndarray, float, float]]:
    """Refined planes (normal, offset, contrast) below the cameras, the best of every height."""
    below = (normals @ centres.T - offsets[:, None]).min(axis=1) > 4.0 * tolerance
    normals, offsets = normals[below], offsets[below]
    if len(normals) == 0:
        return []
    likely = contrast_of(points, normals, offsets, tolerance) * _plausibility(normals, up)
    level = np.floor((normals @ centres.T - offsets[:, None]).mean(axis=1) / (2.0 * tolerance))
    order = np.lexsort((-likely, level))
    best = order[np.concatenate([[True], np.diff(level[order]) != 0])]
    best = best[np.argsort(-likely[best], kind="stable")][:_REFINED]
    refined = (_refined(points, normals[i], offsets[i], up, tolerance, max_tilt_deg) for i in best)
    return [plane for plane in refined if plane is not None]


def _plausibility(normals: np.ndarray, up: np.ndarray) -> np.ndarray:
    """How well normals (..., 3) fit the guess of up, from 0 to 1."""
    tilt_deg = np.degrees(np.arccos(np.clip(normals @ up, -1.0, 1.0)))
    return np.exp(-0.5 * (tilt_deg / _TILT_SIGMA_DEG) ** 2)


def _sampled_planes(points: np.ndarray, up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normals (K, 3) and offsets (K,) through triples of points, half of them neighbours."""
    from scipy.spatial import cKDTree  # Blender's Python knows grounds without it

    rng = np.random.default_rng(0)
    count = len(points)
    far = rng.integers(0, count, (_SAMPLES // 2, 3))
    near = rng.integers(0, count, (_SAMPLES // 2, 3))
    _, neighbours = cKDTree(points).query(points, k=min(_NEIGHBOURS, count))
    pick = rng.integers(0, neighbours.shape[1], (len(near), 2))
    near[:, 1:] = neighbours[near[:, :1], pick]
    a, b, c = points[np.concatenate([far, near])].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1)
    ok = length > 1e-12
    normals, a = normals[ok] / length[ok, None], a[ok]
    normals *= np.where(normals @ up < 0, -1.0, 1.0)[:, None]
    level = normals @ up >= np.cos(np.radians(_MAX_TILT_DEG))
    # Planes of exactly the guessed direction: a floor of few points may miss its triples.
    through = points[rng.integers(0, count, _SAMPLES // 10)]
    normals = np.concatenate([normals[level], np.repeat(up[None], len(through), axis=0)])
    through = np.concatenate([a[level], through])
    return normals, np.einsum("ij,ij->i", normals, through)


def _contrast(points: np.ndarray, normals: np.ndarray, offsets: np.ndarray, tolerance: float) -> np.ndarray:
    """(K,): points on each plane, less what the slabs just above and below would predict.

    A slice through a wall or clutter has as many points above and below as within.
    """
    contrast = np.empty(len(normals))
    count = max(1, _COMPARED_AT_ONCE // len(points))
    for start in range(0, len(normals), count):
        some = slice(start, start + count)
        off = np.abs((normals[some] @ points.T - offsets[some, None]) / tolerance)
        on = (off <= 1.0).sum(axis=1)
        contrast[some] = on - 0.5 * ((off <= _SLAB).sum(axis=1) - on)
    return contrast


def _contrast_of_parallels(
    points: np.ndarray, normals: np.ndarray, offsets: np.ndarray, tolerance: float
) -> np.ndarray:
    """The same of planes that share a normal, by the points' order along it."""
    heights = np.sort(points @ normals[0])

    def within(reach: float) -> np.ndarray:
        first = np.searchsorted(heights, offsets - reach)
        return np.searchsorted(heights, offsets + reach, side="right") - first

    on = within(tolerance)
    return on - 0.5 * (within(_SLAB * tolerance) - on)


def _refined(
    points: np.ndarray, normal: np.ndarray, offset: float, up: np.ndarray, tolerance: float, max_tilt_deg: float
) -> tuple[np.ndarray, float, float] | None:
    """The plane fitted to its own points, or None when they hold none up."""
    on = np.zeros(len(points), bool)
    for share in _REFINEMENT:
        before, on = on, np.abs(points @ normal - offset) <= share * tolerance
        if share == _REFINEMENT[-1] and np.array_equal(before, on):
            break
        if on.sum() < _MIN_SUPPORT:
            return None
        centre = points[on].mean(axis=0)
        _, spread, axes = np.linalg.svd(points[on] - centre, full_matrices=False)
        normal = axes[2] * (1.0 if axes[2] @ up >= 0 else -1.0)
        offset = float(normal @ centre)
    if normal @ up < np.cos(np.radians(max_tilt_deg)):
        return None
    # A line of points, such as the foot of one wall, does not tell a tilt.
    width = spread[1] / np.sqrt(on.sum())
    if width < 4.0 * tolerance:
        return None
    contrast = _contrast(points, normal[None], np.array([offset]), tolerance)[0]
    return normal, offset, float(contrast)


def _settled(points: np.ndarray, normal: np.ndarray, offset: float, tolerance: float) -> tuple[np.ndarray, float]:
    """The plane by Tukey's biweight: what barely lies on it, such as a wall's foot, does not tilt it."""
    for _ in range(_SETTLED_AFTER):
        off = (points @ normal - offset) / tolerance
        on = np.abs(off) < 1.0
        root_weight = 1.0 - off[on] ** 2
        centre = np.average(points[on], axis=0, weights=root_weight**2)
        axis = np.linalg.svd((points[on] - centre) * root_weight[:, None], full_matrices=False)[2][2]
        normal = axis * (1.0 if axis @ normal >= 0 else -1.0)
        offset = float(normal @ centre)
    return normal, offset

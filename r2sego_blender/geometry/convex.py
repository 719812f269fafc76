"""Convex decomposition of an open surface, for simulators that collide convex hulls.

The surface is cut into boxes until no hull of what lies in a box stands out into free space
by more than a tolerance; pieces of one flat are joined again. A hull may fill what lies
*behind* the surface: that is inside things and walls, where nothing moves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree

_OVERLOOKED_AREA = 0.03  # share of a piece's area whose protrusion is noise, not shape
_FACING = 0.2  # cosine from which a hull's facet counts as lying on a triangle's free side
_SAME_FLAT = 0.97  # cosine between the normals of pieces that may be one flat
_SMALLEST_PIECE_M2 = 2e-4


@dataclass(frozen=True)
class Soup:
    """Triangles: ``corners`` (T, 3, 3), ``centroids`` (T, 3), unit ``normals`` (T, 3)
    towards free space and ``areas`` (T,), all float64."""

    corners: np.ndarray
    centroids: np.ndarray
    normals: np.ndarray
    areas: np.ndarray

    @staticmethod
    def of(vertices: np.ndarray, faces: np.ndarray) -> Soup:
        """The triangles of a mesh that have an area."""
        corners = np.asarray(vertices, np.float64)[faces]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(cross, axis=1)
        good = length > 1e-12
        return Soup(corners[good], corners[good].mean(1), cross[good] / length[good, None], length[good] / 2)


@dataclass(frozen=True)
class Limits:
    """``cell_m``: the boxes the cutting starts from; ``smallest_m``: boxes are cut no further;
    ``tolerance_m``: protrusion into free space; ``thickness_m``: of a piece, backwards."""

    cell_m: float
    smallest_m: float
    tolerance_m: float
    thickness_m: float


def decompose(soup: Soup, limits: Limits) -> list[tuple[np.ndarray, np.ndarray]]:
    """Convex pieces (vertices (v, 3) float64, faces (f, 3) int32, counter-clockwise seen from
    outside) that cover the surface; each has a volume. Deterministic."""
    if not len(soup.areas):
        return []
    cells = np.floor((soup.centroids - soup.centroids.min(0)) / limits.cell_m).astype(np.int64)
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    order = np.argsort(cell.ravel(), kind="stable")
    borders = np.flatnonzero(np.diff(cell.ravel()[order])) + 1
    pending = list(np.split(order, borders))[::-1]
    members = []
    while pending:
        piece = pending.pop()
        if _fits(soup, piece, limits) or _extent(soup, piece).max() <= limits.smallest_m:
            members.append(piece)
        else:
            pending.extend(_halves(soup, piece))
    members = _joined(soup, members, limits)
    members = [piece for piece in members if soup.areas[piece].sum() > _SMALLEST_PIECE_M2]
    return [_thick_hull(soup, piece, limits.thickness_m) for piece in members]


def _extent(soup: Soup, piece: np.ndarray) -> np.ndarray:
    return np.ptp(soup.centroids[piece], axis=0)


def _fits(soup: Soup, piece: np.ndarray, limits: Limits) -> bool:
    """Whether the piece's hull keeps within the tolerance in front of its triangles."""
    points = soup.corners[piece].reshape(-1, 3)
    normals = soup.normals[piece]
    mean = (normals * soup.areas[piece, None]).sum(0)
    length = np.linalg.norm(mean)
    if length > 1e-9:
        heights = (points - points[0]) @ (mean / length)
        if np.ptp(heights) <= limits.tolerance_m:  # flat: no hull is needed to see that
            return True
    try:
        planes = ConvexHull(points).equations
    except QhullError:  # exactly flat or a line
        return True
    depth = -(soup.centroids[piece] @ planes[:, :3].T + planes[:, 3])
    in_front = normals @ planes[:, :3].T > _FACING
    protrusion = np.where(in_front, depth, np.inf).min(1)
    too_far = (protrusion > limits.tolerance_m) & np.isfinite(protrusion)
    return soup.areas[piece][too_far].sum() <= _OVERLOOKED_AREA * soup.areas[piece].sum()


def _halves(soup: Soup, piece: np.ndarray) -> list[np.ndarray]:
    """The piece cut across the axis that leaves the two flattest halves."""
    centroids, areas = soup.centroids[piece], soup.areas[piece]
    low, high = centroids.min(0), centroids.max(0)
    longest = (high - low).max()
    best, chosen = np.inf, None
    for axis in range(3):
        if high[axis] - low[axis] < 0.4 * longest:
            continue
        left = centroids[:, axis] < (low[axis] + high[axis]) / 2
        unevenness = sum(_unevenness(centroids[s], areas[s]) for s in (left, ~left))
        if unevenness < best:
            best, chosen = unevenness, left
    return [piece[~chosen], piece[chosen]]


def _unevenness(points: np.ndarray, weights: np.ndarray) -> float:
    """The weighted square distance of points from their best plane."""
    if len(points) < 4:
        return 0.0
    away = points - np.average(points, axis=0, weights=weights)
    return float(max(0.0, np.linalg.eigvalsh((away * weights[:, None]).T @ away)[0]))


def _joined(soup: Soup, members: list[np.ndarray], limits: Limits) -> list[np.ndarray]:
    """Pieces of one flat joined with their neighbours, larger ones first."""
    joined = list(members)
    for _ in range(8):
        if len(joined) < 2:
            break
        areas = np.array([soup.areas[p].sum() for p in joined])
        means = np.array([(soup.normals[p] * soup.areas[p, None]).sum(0) for p in joined])
        length = np.linalg.norm(means, axis=1)
        flat = length > 0.8 * areas
        means /= np.maximum(length, 1e-12)[:, None]
        lows = np.array([soup.corners[p].min((0, 1)) for p in joined])
        highs = np.array([soup.corners[p].max((0, 1)) for p in joined])
        centres, radii = (lows + highs) / 2, np.linalg.norm(highs - lows, axis=1) / 2
        pairs = cKDTree(centres).query_pairs(2 * radii.max(), output_type="ndarray")
        a, b = pairs[:, 0], pairs[:, 1]
        touching = ((lows[a] <= highs[b] + 1e-3) & (lows[b] <= highs[a] + 1e-3)).all(1)
        alike = flat[a] & flat[b] & ((means[a] * means[b]).sum(1) > _SAME_FLAT)
        pairs = pairs[touching & alike]
        pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0], -areas[pairs].sum(1)))]
        taken = np.zeros(len(joined), bool)
        added = []
        for i, j in pairs:
            if taken[i] or taken[j]:
                continue
            union = np.concatenate([joined[i], joined[j]])
            if _fits(soup, union, limits) and _gapless(soup, union, areas[i] + areas[j]):
                taken[i] = taken[j] = True
                added.append(union)
        if not added:
            break
        joined = [p for p, gone in zip(joined, taken, strict=True) if not gone] + added
    return joined


def _gapless(soup: Soup, piece: np.ndarray, area: float) -> bool:
    """Whether a flat piece fills its outline, so that its hull closes no opening."""
    points = soup.corners[piece].reshape(-1, 3)
    mean = (soup.normals[piece] * soup.areas[piece, None]).sum(0)
    mean /= np.linalg.norm(mean)
    axes = np.linalg.svd(mean[None])[2][1:]
    try:
        outline = ConvexHull(points @ axes.T).volume  # in two dimensions, the area
    except QhullError:
        return True
    return outline <= 1.1 * area + 0.01


def _thick_hull(soup: Soup, piece: np.ndarray, thickness: float) -> tuple[np.ndarray, np.ndarray]:
    """The piece's hull with the surface moved back by ``thickness``, away from free space."""
    points = np.unique(np.round(soup.corners[piece].reshape(-1, 3), 6), axis=0)
    mean = (soup.normals[piece] * soup.areas[piece, None]).sum(0)
    length = np.linalg.norm(mean)
    if length > 0.2 * soup.areas[piece].sum():
        points = np.concatenate([points, points - thickness * mean / length])
    else:  # seen from both sides, as a leg or a leaf: thick enough by itself, or nearly so
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        points = (points[:, None] + 0.1 * thickness * corners).reshape(-1, 3)
    hull = ConvexHull(points)
    used, faces = np.unique(hull.simplices, return_inverse=True)
    faces = faces.reshape(-1, 3)
    vertices = points[used]
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return vertices, faces.astype(np.int32)

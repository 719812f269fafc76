"""Convex decomposition of an open surface, for simulators that collide convex hulls.

The surface is cut into boxes until no hull of what lies in a box stands out into free space
by more than a tolerance; pieces of one flat are joined again. A hull may fill what lies
*behind* the surface: that is inside things and walls, where nothing moves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from ...core.progress import SILENT, Progress, Task
from ..mesh.meshes import compacted
from .protrusion import FreeSide, parts_by_area, sampled

_OVERLOOKED_AREA = 0.03  # share of a piece's area whose protrusion is noise, not shape
_UPWARD = 0.5  # cosine from which a side faces up: things come to rest on it
_ASKED_SPACING_M = 0.04  # between points of a piece at which it is looked how far it stands out
_THINNEST_M = 0.005
_COARSENING = 1.3
_CARRYING_SHARE = 0.25
_SAME_FLAT = 0.97  # cosine between the normals of pieces that may be one flat
_SMALLEST_PIECE_M2 = 2e-4
_JOINABLE = 2  # joining flats leaves at least one piece in this many
_JOINED_TOLERANCE = 1.5  # thickness of a joined flat in tolerances: its noise goes both ways
_JOINING_ROUNDS = 10
_PAIRS_AT_ONCE = 2_000_000  # that are looked at for touching: all of 20,000 pieces would take gigabytes
_LOOKS = 4  # at how many parts of a large piece's points it is looked, one after the other
_LARGE = 1000


@dataclass(frozen=True)
class Soup:
    """Triangles: ``corners`` (T, 3, 3), ``centroids`` (T, 3), unit ``normals`` (T, 3)
    towards free space and ``areas`` (T,), all float64; ``points`` (P, 3) are the different
    corners, to a micrometre, and ``faces`` (T, 3) says which are a triangle's."""

    points: np.ndarray
    faces: np.ndarray
    corners: np.ndarray
    centroids: np.ndarray
    normals: np.ndarray
    areas: np.ndarray

    @staticmethod
    def of(vertices: np.ndarray, faces: np.ndarray) -> Soup:
        """The triangles of a mesh that have an area."""
        vertices = np.asarray(vertices, np.float64)
        points, point = np.unique(np.round(vertices, 6), axis=0, return_inverse=True)
        corners = vertices[faces]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(cross, axis=1)
        good = length > 1e-12
        return Soup(
            points,
            point.ravel()[faces[good]],
            corners[good],
            corners[good].mean(1),
            cross[good] / length[good, None],
            length[good] / 2,
        )


@dataclass(frozen=True)
class Limits:
    """``cell_m``: the boxes the cutting starts from; ``smallest_m``: boxes are cut no further;
    ``tolerance_m``: how far a piece may stand out into free space; ``carrying_m``: the same
    for its sides that face up; ``thickness_m``: of a piece, backwards, at most."""

    cell_m: float
    smallest_m: float
    tolerance_m: float
    carrying_m: float
    thickness_m: float

    def coarser(self) -> Limits:
        """Limits that fewer pieces keep; what carries is given up last."""
        tolerance_m = _COARSENING * self.tolerance_m
        return Limits(
            _COARSENING * self.cell_m,
            _COARSENING * self.smallest_m,
            tolerance_m,
            max(self.carrying_m, _CARRYING_SHARE * tolerance_m),
            self.thickness_m,
        )


Piece = tuple[np.ndarray, np.ndarray]
"""A convex piece: vertices (v, 3) float64 and faces (f, 3) int32, counter-clockwise."""


def decompose(
    soup: Soup, limits: Limits, most: int, floored: bool = False, progress: Progress = SILENT
) -> tuple[list[Piece], Limits]:
    """At most ``most`` convex pieces that cover the surface, and the limits they keep: those
    given, or coarser ones where they would be more.

    ``floored`` says that z = 0 is a floor, on which pieces stand out as well. A piece is closed
    and has a volume. Deterministic.
    """
    if not len(soup.areas):
        return [], limits
    free = FreeSide.of(soup.corners, soup.normals, floored)
    while True:
        cutting = Cutting(soup, free, limits)
        members = _members(cutting, most, progress)
        if members is not None:
            return [cutting.solid(piece) for piece in members], limits
        limits = limits.coarser()


@dataclass(frozen=True)
class Cutting:
    """What pieces are cut from, and the limits they are held to.

    A piece is given as the indices (n,) of its triangles in ``soup``.
    """

    soup: Soup
    free: FreeSide
    limits: Limits

    def fits(self, piece: np.ndarray) -> bool:
        """Whether the solid of these triangles stands out no farther than the limits."""
        vertices, faces = self.solid(piece)
        corners = vertices[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        double = np.linalg.norm(normals, axis=1)
        carrying = normals[:, 2] > _UPWARD * double
        points, facet = sampled(corners, parts_by_area(double, _ASKED_SPACING_M))
        weights = (double / np.bincount(facet, minlength=len(faces)))[facet]
        looks = _LOOKS if len(points) > _LARGE else 1
        overlooked = _OVERLOOKED_AREA * double.sum()
        for look in range(looks):  # most of what does not fit is seen at once
            some = slice(look, None, looks)
            out = self.free.standing_out(points[some])
            if (out[carrying[facet[some]]] > self.limits.carrying_m).any():
                return False
            overlooked -= weights[some][out > self.limits.tolerance_m].sum()
            if overlooked < 0.0:
                return False
        return True

    def solid(self, piece: np.ndarray) -> Piece:
        """The hull of the triangles and of themselves moved back, away from their free side.

        They move as far as the limits say, or less where they would come out behind.
        """
        soup, thickness_m = self.soup, self.limits.thickness_m
        points = soup.points[np.unique(soup.faces[piece])]
        mean = soup.areas[piece] @ soup.normals[piece]
        length = np.sqrt(mean @ mean)
        if length > 0.2 * soup.areas[piece].sum():
            back = points - thickness_m * mean / length
            while thickness_m > _THINNEST_M and self.free.standing_out(back).max() > 0.0:
                thickness_m /= 2
                back = points - thickness_m * mean / length
            points = np.concatenate([points, back])
        else:  # seen from both sides, as a leg or a leaf: thick enough by itself, or nearly so
            corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
            points = (points[:, None] + 0.1 * thickness_m * corners).reshape(-1, 3)
        return convex_hull(points)


def _members(cutting: Cutting, most: int, progress: Progress) -> list[np.ndarray] | None:
    """The triangles' indices by piece, None when there would be more than ``most`` pieces."""
    areas = cutting.soup.areas
    with progress.task("Cutting into convex pieces", len(areas)) as task:
        members = _partition(cutting, _JOINABLE * most, task)
    if members is None:
        return None
    with progress.task("Joining flat pieces", _JOINING_ROUNDS) as task:
        members = _joined(cutting, members, task)
    members = [piece for piece in members if areas[piece].sum() > _SMALLEST_PIECE_M2]
    return members if len(members) <= most else None


def _partition(cutting: Cutting, most: int, task: Task) -> list[np.ndarray] | None:
    """Boxes cut until what is in them fits, or they are small; None when they are more than ``most``."""
    soup, limits = cutting.soup, cutting.limits
    cells = np.floor((soup.centroids - soup.centroids.min(0)) / limits.cell_m).astype(np.int64)
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    order = np.argsort(cell.ravel(), kind="stable")
    borders = np.flatnonzero(np.diff(cell.ravel()[order])) + 1
    pending = list(np.split(order, borders))[::-1]
    members = []
    while pending:
        piece = pending.pop()
        if _extent(soup, piece).max() <= limits.smallest_m or cutting.fits(piece):
            members.append(piece)
            task.advance(len(piece))
        else:
            pending.extend(_halves(soup, piece))
        if len(members) + len(pending) > most:
            return None
    return members


def _extent(soup: Soup, piece: np.ndarray) -> np.ndarray:
    return np.ptp(soup.centroids[piece], axis=0)


def _height_range(soup: Soup, piece: np.ndarray) -> float:
    """How thick the piece is along its mean normal; inf where it has none."""
    mean = soup.areas[piece] @ soup.normals[piece]
    length = float(np.sqrt(mean @ mean))
    if length < 1e-9:
        return np.inf
    heights = soup.corners[piece].reshape(-1, 3) @ (mean / length)
    return float(heights.max() - heights.min())


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
    assert chosen is not None  # the longest axis is tried
    return [piece[~chosen], piece[chosen]]


def _unevenness(points: np.ndarray, weights: np.ndarray) -> float:
    """The weighted square distance of points from their best plane."""
    if len(points) < 4:
        return 0.0
    away = points - np.average(points, axis=0, weights=weights)
    return float(max(0.0, np.linalg.eigvalsh((away * weights[:, None]).T @ away)[0]))


def _joined(cutting: Cutting, members: list[np.ndarray], task: Task) -> list[np.ndarray]:
    """Pieces of one flat joined with their neighbours, larger ones first."""
    soup, limits = cutting.soup, cutting.limits
    pieces = dict(enumerate(members))
    refused: set[tuple[int, int]] = set()
    for _ in range(_JOINING_ROUNDS):
        names = np.array(sorted(pieces))
        if len(names) < 2:
            break
        areas = np.array([soup.areas[pieces[n]].sum() for n in names])
        means = np.array([soup.areas[pieces[n]] @ soup.normals[pieces[n]] for n in names])
        length = np.linalg.norm(means, axis=1)
        flat = length > 0.8 * areas
        means /= np.maximum(length, 1e-12)[:, None]
        lows = np.array([soup.corners[pieces[n]].min((0, 1)) for n in names])
        highs = np.array([soup.corners[pieces[n]].max((0, 1)) for n in names])
        first, second = _touching(lows, highs, np.flatnonzero(flat))
        alike = np.einsum("ij,ij->i", means[first], means[second]) > _SAME_FLAT
        first, second = first[alike], second[alike]
        order = np.lexsort((second, first, -(areas[first] + areas[second])))
        changed: set[int] = set()
        for i, j in zip(first[order].tolist(), second[order].tolist(), strict=True):
            a, b = int(names[i]), int(names[j])
            if a in changed or b in changed or (a, b) in refused:
                continue
            union = np.concatenate([pieces[a], pieces[b]])
            flat_enough = _height_range(soup, union) <= _JOINED_TOLERANCE * limits.tolerance_m
            if flat_enough and cutting.fits(union):
                changed |= {a, b}
                del pieces[b]
                pieces[a] = union
                refused = {pair for pair in refused if a not in pair and b not in pair}
            else:
                refused.add((a, b))
        task.advance()
        if not changed:
            break
    task.advance(task.total - task.done)
    return [pieces[n] for n in sorted(pieces)]


def _touching(lows: np.ndarray, highs: np.ndarray, among: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The pairs (first, second) of ``among``, in its order, whose boxes (N, 3) touch."""
    firsts, seconds = [], []
    step = max(1, _PAIRS_AT_ONCE // max(1, len(among)))
    for start in range(0, len(among), step):
        rows, columns = among[start : start + step, None], among[None, start + 1 :]
        touch = ((lows[rows] <= highs[columns] + 1e-3) & (lows[columns] <= highs[rows] + 1e-3)).all(2)
        row, column = np.nonzero(np.triu(touch))
        firsts.append(rows[row, 0])
        seconds.append(columns[0, column])
    if not firsts:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    return np.concatenate(firsts), np.concatenate(seconds)


def convex_hull(points: np.ndarray) -> Piece:
    """The hull of points (N, 3) that do not lie in one plane."""
    hull = ConvexHull(points)
    vertices, faces = compacted(points, hull.simplices)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return vertices, faces

"""How well matches tell the places of solved photographs: directions by each pair, lengths by what three see.

A pair of photographs tells the direction from one to the other and no length. Places are told up to one scale where
pairs close loops, or points that three photographs see tell the ratio of two lengths: parallel rigidity (Ozyesil and
Singer, "Robust camera location estimation by convex programming", CVPR 2015), here with the uncertainty of each.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from ...core.cameras import Camera
from ..matching.features import epipolar_errors
from ..matching.overlap import Matched

View = tuple[Camera, np.ndarray]
"""A photograph's pinhole camera, and its keypoints (n, 2) freed of distortion."""

_LEAST_MATCHES, _LEAST_COMMON = 8, 2  # of a pair, and of what three photographs see: one alone may be a mistake
_MOST_COMMON = 25  # more are no surer: they err together
_RAY_OFF = 0.003  # radians
_LEAST_ANGLE = 1e-3  # between rays that tell a distance
_SAME_DISTANCE = 0.1  # or thrice what rays tell


class _Pair(NamedTuple):
    """Two photographs: ``away`` (3,) from the first to the second, and how far what both see lies from each.

    ``distances`` are those of the keypoints of each, by their index.
    """

    ends: tuple[int, int]
    away: np.ndarray
    distances: tuple[dict[int, float], dict[int, float]]

    @property
    def length(self) -> float:
        return float(np.linalg.norm(self.away))

    @property
    def reach(self) -> float:
        """How far away what both see lies, about."""
        return float(np.median(list(self.distances[0].values())))


def place_deviations(views: Mapping[int, View], matched: Matched, within_px: float) -> dict[int, float]:
    """The standard deviation of each place, in shares of how far the places spread; huge for one that nothing tells.

    Matches that lie on the epipolar lines of ``views``, by their photographs' index, count.
    """
    pairs = list(_pairs(views, matched, within_px))
    order = {index: row for row, index in enumerate(views)}
    places = np.array([camera.centre for camera, _ in views.values()])
    places = places - places.mean(axis=0)
    spread = np.sqrt((places**2).sum(axis=1).mean())
    if len(places) < 2 or spread == 0.0:
        return dict.fromkeys(views, np.inf)
    rows = [row for pair in pairs for row in _direction_rows(pair, order)]
    rows += [row for of_three in _triples(pairs) for row in _length_rows(*of_three, order)]
    free = np.concatenate([np.tile(np.eye(3), len(places)), places.reshape(1, -1)])  # moved and scaled together
    basis = np.linalg.svd(free, full_matrices=True)[2][4:]
    reduced = np.array(rows).reshape(-1, 3 * len(places)) @ basis.T
    values, vectors = np.linalg.eigh(reduced.T @ reduced)
    sure = values > 1e-12 * max(values.max(initial=0.0), 1e-12)
    variances = np.where(sure, 1.0 / np.where(sure, values, 1.0), 1e12 * spread**2)
    of_places = ((basis.T @ vectors) ** 2 @ variances).reshape(-1, 3).sum(axis=1)
    return {index: float(np.sqrt(of_places[row]) / spread) for index, row in order.items()}


def _pairs(views: Mapping[int, View], matched: Matched, within_px: float) -> Iterator[_Pair]:
    for (i, j), matches in matched.pairs.items():
        if i not in views or j not in views:
            continue
        (camera_i, pixels_i), (camera_j, pixels_j) = views[i], views[j]
        of_i, of_j = pixels_i[matches[:, 0]], pixels_j[matches[:, 1]]
        agree = epipolar_errors(of_i, of_j, camera_i, camera_j) <= within_px
        away = camera_j.centre - camera_i.centre
        from_i, from_j, sine = distances(world_rays(camera_i, of_i), world_rays(camera_j, of_j), away)
        told = agree & (from_i > 0.0) & (from_j > 0.0) & (sine > _LEAST_ANGLE)
        if told.sum() >= _LEAST_MATCHES:
            of_keypoints = [
                dict(zip(matches[told, end].tolist(), off[told].tolist(), strict=True))
                for end, off in enumerate((from_i, from_j))
            ]
            yield _Pair((i, j), away, (of_keypoints[0], of_keypoints[1]))


def distances(rays_i: np.ndarray, rays_j: np.ndarray, away: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where unit rays (n, 3) from two centres, the second ``away`` (3,) from the first, pass each other: (n,) from
    each centre, negative behind it, and (n,) the sine between them."""
    along = (rays_i * rays_j).sum(axis=1)
    across = np.maximum(1.0 - along**2, 1e-12)
    from_i = (rays_i @ away - along * (rays_j @ away)) / across
    from_j = (along * (rays_i @ away) - rays_j @ away) / across
    return from_i, from_j, np.sqrt(across)


def world_rays(camera: Camera, pixels: np.ndarray) -> np.ndarray:
    """Unit rays (n, 3) in the world of pixels (n, 2)."""
    ahead = np.column_stack([(pixels - [camera.cx, camera.cy]) / [camera.fx, camera.fy], np.ones(len(pixels))])
    rays = ahead @ camera.world_from_camera[:3, :3].T
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def _direction_rows(pair: _Pair, order: Mapping[int, int]) -> Iterator[np.ndarray]:
    """What moves the ends of a pair across its direction is seen, by how far away things are."""
    for across in np.linalg.svd(pair.away[None])[2][1:]:
        yield _row(order, {pair.ends[1]: across, pair.ends[0]: -across}) / (_RAY_OFF * pair.reach)


def _triples(pairs: list[_Pair]) -> Iterator[tuple[_Pair, _Pair, float]]:
    """Two pairs with one photograph in common and things that all three see, and how sure these tell lengths' ratio."""
    for first, one in enumerate(pairs):
        for other in pairs[first + 1 :]:
            for middle in set(one.ends) & set(other.ends):
                near, far = one.distances[one.ends.index(middle)], other.distances[other.ends.index(middle)]
                common = sorted(near.keys() & far.keys())
                distances = np.array([[of_pair[point] for point in common] for of_pair in (near, far)])
                offs = _RAY_OFF * distances[0] * np.hypot(1.0 / one.length, 1.0 / other.length)
                ratios = np.abs(np.log(distances[0] / distances[1]))
                agreeing = offs[ratios <= np.maximum(_SAME_DISTANCE, 3.0 * offs)]
                if len(agreeing) >= _LEAST_COMMON:
                    yield one, other, float(np.median(agreeing) / np.sqrt(min(len(agreeing), _MOST_COMMON)))


def _length_rows(one: _Pair, other: _Pair, off: float, order: Mapping[int, int]) -> Iterator[np.ndarray]:
    """What changes the ratio of two lengths is seen."""
    longer = [_row(order, {p.ends[1]: p.away / p.length**2, p.ends[0]: -p.away / p.length**2}) for p in (one, other)]
    yield (longer[0] - longer[1]) / off


def _row(order: Mapping[int, int], of_places: Mapping[int, np.ndarray]) -> np.ndarray:
    row = np.zeros((len(order), 3))
    for index, derivative in of_places.items():
        row[order[index]] += derivative
    return row.ravel()

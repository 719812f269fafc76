"""The backdrop: coarse Gaussians behind everything, for what no photograph shows.

A splat asset trained on a few captures is empty beyond them, and a view of the emptiness
is black. The backdrop is a closed shell around the captures instead: in each direction it
stands where the farthest thing was seen, and where nothing was seen it continues the
directions around it, in distance and in colour, those at its own height first: a wall goes
on as the walls beside it, not as the floor below. There its Gaussians lie along it, so it
is closed from wherever a robot goes, not from its centre alone. It stands behind all that the captures
see, as these see it and from places in the room: splats are drawn by their depth, and before a surface
it would be fog. It is a guess, never geometry: the asset deficit, the proxy and the collision surface
are made without it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ..asset import SplatAsset
from .initialization import DepthView, gaussians

_STRIDE_PX = 4  # of the pixels that are looked at
_FAR_QUANTILE = 0.9  # of the distances seen in a direction: a few stray depths do not count
_FAR_SHARE = 0.9  # pixels at least this near the far distance give the colour
_NEIGHBOURS = 32  # seen directions that an unseen one is interpolated from
_UPRIGHT = np.array([1.0, 1.0, 5.0])  # directions up and down count as this much farther than across
_SIGMA = 0.7  # standard deviation over the spacing of directions: no gaps between neighbours
_OPACITY = 0.95
_CLEARANCE = 1.03  # the shell stands this much behind what was seen: surfaces stay in front
_GROWTH = 1.05  # step by which a direction that a capture saw through is moved outwards
_LARGEST_GROWTH = 10.0
_REACH = 2.0  # standard deviations within which a Gaussian must not cover what was seen behind it
_PLANE_NEIGHBOURS = 7  # directions, itself among them, whose plane a Gaussian lies in
_PLANE_WITHIN = 0.2  # of the distance, which they may be off it
_LARGEST_REACH_PX = 60.0
_SEEN_THROUGH = 0.97  # a capture whose depth is this much larger saw through
_ROWS, _COLUMNS = 64, 128  # of a panorama: cells of three degrees
_MOST_POINTS, _MOST_PLACES = 200_000, 100  # that panoramas are made of


def backdrop(views: Sequence[DepthView], directions: int) -> SplatAsset:
    """A closed shell of ``directions`` or a few fewer Gaussians around the views; degree 0.

    ``views`` are captures with depth for as many pixels as possible; their masks and
    strides do not matter. Empty when no view has any depth or ``directions`` is 0. No
    Gaussian stands before a surface that a view shows, from there or from other places in the
    room: it is moved outwards until it does not, or left out.
    """
    centre = np.median([view.camera.centre for view in views], axis=0) if views else np.zeros(3)
    points, colours = _seen(views)
    if not len(points) or not directions:
        return SplatAsset.empty()
    around = _fibonacci_sphere(directions)
    distance_m, colour, known = _farthest(points - centre, colours, around)
    if not known.all():
        filled = _interpolated(around, known, np.column_stack([np.log(distance_m), colour]))
        distance_m, colour = np.exp(filled[:, 0]), filled[:, 1:]
    spacing = np.sqrt(4.0 * np.pi / directions)
    panoramas = _panoramas(views, points)
    distance_m = _behind_what_is_seen(centre, around, _CLEARANCE * distance_m, _SIGMA * spacing, views, panoramas)
    kept = np.isfinite(distance_m)
    around, distance_m, known = around[kept], distance_m[kept], known[kept]
    means = centre + around * distance_m[:, None]
    axes, lengths = _along_the_shell(around, distance_m)
    sigma_m = _SIGMA * spacing * distance_m[:, None]
    # Before a surface that the asset has a long one is a haze: splats are sorted by their centres.
    lengths[known] = 1.0
    long = np.flatnonzero(~known)
    lengths[long[_reach_over(means[long], axes[long], (sigma_m * lengths)[long], views, panoramas)]] = 1.0
    return gaussians(
        means=means,
        sigmas_m=sigma_m * lengths,
        quaternions=Rotation.from_matrix(axes).as_quat(scalar_first=True),
        opacity=_OPACITY,
        colours=colour[kept],
    )


def _seen(views: Sequence[DepthView]) -> tuple[np.ndarray, np.ndarray]:
    """World points (P, 3) of every few pixels with depth, and their colours (P, 3)."""
    grid = (slice(_STRIDE_PX // 2, None, _STRIDE_PX),) * 2
    points, colours = [np.empty((0, 3))], [np.empty((0, 3))]
    for view in views:
        known = view.depth[grid] > 0.0
        points.append(view.camera.unproject(view.depth)[grid][known])
        colours.append(view.image[grid][known])
    return np.concatenate(points), np.concatenate(colours)


def _fibonacci_sphere(count: int) -> np.ndarray:
    """(count, 3) unit vectors, evenly spread."""
    index = np.arange(count)
    height = 1.0 - (2.0 * index + 1.0) / count
    turn = index * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - height**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)


def _farthest(
    offsets: np.ndarray, colours: np.ndarray, around: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For each direction (D, 3) how far (D,) and of what colour (D, 3) the far points are.

    The third is which directions (D,) bool were seen at all; the others are 1 m and black.
    """
    distance_m = np.maximum(np.linalg.norm(offsets, axis=1), 1e-6)
    _, cell = cKDTree(around).query(offsets / distance_m[:, None])
    order = np.lexsort((distance_m, cell))
    seen, first, count = np.unique(cell[order], return_index=True, return_counts=True)
    chosen = order[first + (_FAR_QUANTILE * (count - 1)).astype(np.int64)]
    far_m = np.ones(len(around))
    far_m[seen] = distance_m[chosen]
    is_far = distance_m >= _FAR_SHARE * far_m[cell]
    total = np.bincount(cell[is_far], minlength=len(around))
    colour = (
        np.stack([np.bincount(cell[is_far], colours[is_far, k], minlength=len(around)) for k in range(3)], axis=1)
        / np.maximum(total, 1)[:, None]
    )
    return far_m, colour, total > 0


def _interpolated(around: np.ndarray, known: np.ndarray, values: np.ndarray) -> np.ndarray:
    """``values`` (D, C) where ``known``; elsewhere the mean of the nearest known directions,
    weighted by the inverse square of their distance. Rooms are alike across, not upwards."""
    neighbours = min(_NEIGHBOURS, int(known.sum()))
    stretched = around * _UPRIGHT
    distance, index = cKDTree(stretched[known]).query(stretched[~known], k=neighbours)
    weight = 1.0 / np.square(distance.reshape(-1, neighbours, 1))
    near = values[known][index.reshape(-1, neighbours)]
    filled = values.copy()
    filled[~known] = (weight * near).sum(axis=1) / weight.sum(axis=1)
    return filled


@dataclass(frozen=True)
class _Panorama:
    """What the captures see, from one place all around: ``distance_m`` (rows, columns) of the nearest point in each
    direction, 0 where there is none."""

    place: np.ndarray
    distance_m: np.ndarray

    @staticmethod
    def of(place: np.ndarray, points: np.ndarray) -> _Panorama:
        """That of world points (P, 3)."""
        cell, distance_m = _cells(points - place)
        nearest_m = np.full(_ROWS * _COLUMNS, np.inf)
        np.minimum.at(nearest_m, cell, distance_m)
        return _Panorama(place, np.where(np.isfinite(nearest_m), nearest_m, 0.0))

    def stand_before(self, points: np.ndarray) -> np.ndarray:
        """(n,) bool: which of the points (n, 3) hide one that is seen there."""
        cell, distance_m = _cells(points - self.place)
        return distance_m < _SEEN_THROUGH * self.distance_m[cell]

    def covered_by(self, means: np.ndarray, sigma_m: np.ndarray) -> np.ndarray:
        """(n,) bool: which round Gaussians hide what is seen there."""
        offset = means - self.place
        across = np.stack([-offset[:, 1], offset[:, 0], np.zeros(len(offset))], axis=1)
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
        along = np.cross(offset, across)
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
        reach_m = _REACH * sigma_m[:, None]
        return np.any(
            [self.stand_before(means + reach_m * way) for way in (0.0 * across, across, -across, along, -along)], axis=0
        )


def _cells(offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The cell (n,) of a panorama in which each of the ``offsets`` (n, 3) lies, and its length (n,)."""
    length = np.maximum(np.linalg.norm(offsets, axis=1), 1e-9)
    turn = np.arctan2(offsets[:, 1], offsets[:, 0]) / (2.0 * np.pi) + 0.5
    height = np.arccos(np.clip(offsets[:, 2] / length, -1.0, 1.0)) / np.pi
    row = np.minimum((height * _ROWS).astype(np.int64), _ROWS - 1)
    return row * _COLUMNS + np.minimum((turn * _COLUMNS).astype(np.int64), _COLUMNS - 1), length


def _panoramas(views: Sequence[DepthView], points: np.ndarray) -> list[_Panorama]:
    """Of world points (P, 3) that the views show, from where these stand and from half-way to what they show:
    places of which they tell that they are free."""
    places = []
    for view in views:
        places.append(view.camera.centre)
        rows, columns = ((size // 4, 3 * size // 4) for size in view.camera.shape)
        shown = view.camera.unproject(view.depth)[np.ix_(rows, columns)].reshape(-1, 3)
        places += [(view.camera.centre + point) / 2.0 for point in shown[view.depth[np.ix_(rows, columns)].ravel() > 0]]
    few = points[:: -(-len(points) // _MOST_POINTS)]
    return [_Panorama.of(place, few) for place in places[:: -(-len(places) // _MOST_PLACES)]]


def _behind_what_is_seen(
    centre: np.ndarray,
    around: np.ndarray,
    distance_m: np.ndarray,
    sigma: float,
    views: Sequence[DepthView],
    panoramas: Sequence[_Panorama],
) -> np.ndarray:
    """The distances (D,), grown until neither views nor panoramas see a surface behind them; infinite if never."""
    grown = distance_m.copy()
    open_ = np.arange(len(grown))
    while len(open_):
        means = centre + around[open_] * grown[open_, None]
        sigma_m = sigma * grown[open_]
        covers = np.zeros(len(open_), bool)
        for view in views:
            covers |= _covers(means, sigma_m, view)
        for panorama in panoramas:
            covers[~covers] = panorama.covered_by(means[~covers], sigma_m[~covers])
        open_ = open_[covers]
        grown[open_] *= _GROWTH
        grown[open_[grown[open_] > _LARGEST_GROWTH * distance_m[open_]]] = np.inf
        open_ = open_[np.isfinite(grown[open_])]
    return grown


def _along_the_shell(around: np.ndarray, distance_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Axes (D, 3, 3), in columns, and lengths (D, 3) of unit spheres around the directions (D, 3) when
    each is carried out to where the shell stands (D,): as it slopes there they lean and stretch.

    Round ones would close it for an eye at its centre alone: from elsewhere gaps open where it slopes.
    """
    _, index = cKDTree(around).query(around, k=min(_PLANE_NEIGHBOURS, len(around)))
    index = index.reshape(len(around), -1)
    beside, nearness = around[index], 1.0 / distance_m[index]
    # Of a plane the inverse of the distance is linear in the direction; a step is no plane, and nothing closes it.
    plane = np.einsum("dkn,dn->dk", np.linalg.pinv(beside), nearness)
    off = np.abs(np.einsum("dnk,dk->dn", beside, plane) / nearness - 1.0).max(axis=1)
    slope = -distance_m[:, None] * (plane - np.einsum("dk,dk->d", plane, around)[:, None] * around)
    slope[off > _PLANE_WITHIN] = 0.0
    carried = np.eye(3) + around[:, :, None] * slope[:, None, :]
    axes, lengths, _ = np.linalg.svd(carried)
    axes[:, :, 2] *= np.sign(np.linalg.det(axes))[:, None]
    return axes, lengths


def _reach_over(
    means: np.ndarray,
    axes: np.ndarray,
    sigmas_m: np.ndarray,
    views: Sequence[DepthView],
    panoramas: Sequence[_Panorama],
) -> np.ndarray:
    """(n,) bool: which Gaussians hide a surface that is seen anywhere along their two longer axes."""
    reaching = np.zeros(len(means), bool)
    for axis in (0, 1):
        for sigmas in np.linspace(-_REACH, _REACH, 9):
            points = means + sigmas * sigmas_m[:, axis, None] * axes[:, :, axis]
            for view in views:
                reaching |= _stand_before(*view.camera.project(points), view)
            for panorama in panoramas:
                reaching |= panorama.stand_before(points)
    return reaching


def _covers(means: np.ndarray, sigma_m: np.ndarray, view: DepthView) -> np.ndarray:
    """(n,) bool: which Gaussians hide a surface that the view shows."""
    pixels, depth = view.camera.project(means)
    reach_px = np.minimum(_REACH * sigma_m * view.camera.fx / np.maximum(depth, 1e-6), _LARGEST_REACH_PX)
    covered = np.zeros(len(means), bool)
    for offset in ((0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)):
        covered |= _stand_before(pixels + reach_px[:, None] * offset, depth, view)
    return covered


def _stand_before(pixels: np.ndarray, depth: np.ndarray, view: DepthView) -> np.ndarray:
    """(n,) bool: which of the points, at (n, 2) and (n,) metres, stand before what the view shows there."""
    inside = view.camera.sees(pixels, depth)
    column, row = np.where(inside[:, None], pixels, 0.0).astype(np.int64).T
    return inside & (depth < _SEEN_THROUGH * view.depth[row, column])

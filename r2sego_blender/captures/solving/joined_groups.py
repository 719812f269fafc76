"""Groups of photographs that share one photograph and no point of three: joined in one scale by that one's surfaces.

The shared photograph tells how one group is turned and where it stands from the other, and no length. But what the
groups measured lies side by side in its picture, mostly on the same surfaces, so it is about as far away: the length
is that with which most of these distances agree.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from ...core.cameras import Camera
from ..matching.features import epipolar_errors
from ..matching.overlap import Matched
from .mapping import MIN_AGREEING_SHARE, agreements_of_views
from .place_certainty import View, distances, world_rays

_BESIDE = 0.04  # of the longest side, within which points of the two groups lie side by side
_FADE = 0.01  # of the longest side, over which they count e times less
_NEIGHBOURS = 8
_LEAST_SINE = 0.0175  # between rays that tell a distance: a degree
_LEAST_BESIDE = 12  # points of a group that lie beside the other's
_WIDTH, _SAME_LENGTH, _LEAST_SUPPORT = 0.05, 0.1, 0.6  # in logarithms; of distances that tell the length


class _Measured(NamedTuple):
    """The pixels (n, 2) of a photograph that others measured, and how far away (n,) what they show is."""

    pixels: np.ndarray
    away: np.ndarray


def joined_by_surfaces(
    views: Mapping[int, View], group: Mapping[int, View], matched: Matched, within_px: float
) -> dict[int, Camera]:
    """The cameras of a ``group`` of another frame and scale in that of ``views``.

    None where nothing tells these, and where most matches between photographs that only one has contradict it. Of
    several photographs that both have the one counts of which most points lie side by side. ``within_px`` is how far
    matches may lie off their epipolar lines.
    """
    best: tuple[int, dict[int, Camera]] = (0, {})
    for shared in sorted(views.keys() & group.keys()):
        of_views, of_group = (_measured(shared, some, matched, within_px) for some in (views, group))
        longer, count = _length(of_views, of_group, max(views[shared][0].shape))
        if count > best[0]:
            views_from_group = _similarity(views[shared][0], group[shared][0], longer)
            moved = {index: camera.transformed(views_from_group) for index, (camera, _) in group.items()}
            best = count, moved
    placed = {index: (camera, group[index][1]) for index, camera in best[1].items()}
    return {} if _contradicted(views, placed, matched, within_px) else best[1]


def _contradicted(views: Mapping[int, View], group: Mapping[int, View], matched: Matched, within_px: float) -> bool:
    only = views.keys() - group.keys(), group.keys() - views.keys()
    between = {pair: rows for pair, rows in matched.pairs.items() if all(one.intersection(pair) for one in only)}
    counts = agreements_of_views({**group, **views}, Matched(matched.features, between), within_px)
    agreeing, total = sum(counts.values(), np.zeros(2))
    return bool(agreeing < MIN_AGREEING_SHARE * total)


def _measured(shared: int, views: Mapping[int, View], matched: Matched, within_px: float) -> _Measured:
    pixels, away = [np.empty((0, 2))], [np.empty(0)]
    camera, keypoints = views[shared]
    for pair, matches in matched.pairs.items():
        if shared not in pair or (other := pair[1 - pair.index(shared)]) not in views:
            continue
        own, theirs = matches[:, pair.index(shared)], matches[:, 1 - pair.index(shared)]
        far, others = views[other]
        near = epipolar_errors(keypoints[own], others[theirs], camera, far) <= within_px
        rays, from_there = world_rays(camera, keypoints[own]), world_rays(far, others[theirs])
        from_own, from_other, sine = distances(rays, from_there, far.centre - camera.centre)
        told = near & (from_own > 0.0) & (from_other > 0.0) & (sine > _LEAST_SINE)
        pixels.append(keypoints[own[told]])
        away.append(from_own[told])
    return _Measured(np.concatenate(pixels), np.concatenate(away))


def _length(one: _Measured, other: _Measured, longest_px: int) -> tuple[float, int]:
    """How many times longer the unit of ``other`` is, and how many of its points lie beside points of ``one``; 0 where
    too few do, or their distances do not agree."""
    if not len(one.pixels) or not len(other.pixels):
        return 1.0, 0
    count = min(_NEIGHBOURS, len(one.pixels))
    off_px, index = (found.reshape(-1, count) for found in cKDTree(one.pixels).query(other.pixels, k=count))
    beside = off_px < _BESIDE * longest_px
    points = int(beside.any(axis=1).sum())
    if points < _LEAST_BESIDE:
        return 1.0, 0
    ratios = (np.log(one.away[index]) - np.log(other.away)[:, None])[beside]
    weight = np.exp(-off_px[beside] / (_FADE * longest_px))
    densities = (weight * np.exp(-0.5 * np.square((ratios[:, None] - ratios) / _WIDTH))).sum(axis=1)
    mode = ratios[densities.argmax()]
    agree = np.abs(ratios - mode) < _SAME_LENGTH
    if weight[agree].sum() < _LEAST_SUPPORT * weight.sum():
        return 1.0, 0
    return float(np.exp(np.average(ratios[agree], weights=weight[agree]))), points


def _similarity(camera: Camera, of_group: Camera, longer: float) -> np.ndarray:
    """(4, 4) that brings a photograph's pose in its group to that of ``camera``, and makes lengths ``longer``."""
    similarity: np.ndarray = camera.world_from_camera @ np.diag([longer] * 3 + [1.0]) @ of_group.camera_from_world
    return similarity

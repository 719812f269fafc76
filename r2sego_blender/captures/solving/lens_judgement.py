"""Whether tracks between photographs of known poses say another lens than the given one."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from ...core.cameras import Camera
from .bundle_adjustment import LENS_TERMS, AdjustedLenses, adjusted_lenses
from .conventions import zoomed
from .intersections import intersections

# The terms that are freed together: focal length, principal point, radial distortion.
_BLOCKS = ((0,), (1, 2), (3, 4))
# Tracks looked at, the longest; errors beyond this are those of wrong matches.
_MOST_TRACKS = 3000
_ERRANT_PX = 200.0
# The cost under the given lens over that under a free one. Right lenses of rendered photographs leave 1.00,
# the calibrated one of a head-mounted camera 1.05; a focal length that is 5 % wrong 1.8, a principal point 3 %
# off 1.3, a missing k1 of -0.1 1.5. With poses that may be wrong three times as far it is 1.18 at least.
_CLEARLY_LOWER, _CLEARLY_LOWER_OF_LOOSE = 1.15, 1.1
_LOOSE = 3.0
# Fewer terms are preferred where they cost so little more.
_AS_GOOD = 1.04
# A lens is determined where its focal length is known so well, and loose poses say the same.
_FOCAL_SIGMA, _FOCAL_AGREES = 0.03, 0.05
_LOSS_PX = 0.5


class LensVerdict(NamedTuple):
    """What tracks say of groups' lenses.

    ``terms`` (G, LENS_TERMS) float64 correct them (``bundle_adjustment``), 0 where nothing is to be corrected;
    ``determined`` says whether they are to be trusted. Median reprojection errors, in pixels: ``given_px`` of
    what was given, ``poses_px`` with poses adjusted alone, ``lenses_px`` with lenses, too.
    """

    terms: np.ndarray
    determined: bool
    given_px: float
    poses_px: float
    lenses_px: float


def lens_groups(cameras: Sequence[Camera]) -> np.ndarray:
    """(N,) int64: photographs that share a lens, by size and given intrinsics within 3 %.

    Phones state slightly different ones for each photograph: a correction is common to all of a group.
    """
    first: list[Camera] = []
    group = []
    for camera in cameras:
        same = (index for index, other in enumerate(first) if _same_lens(camera, other))
        index = next(same, len(first))
        if index == len(first):
            first.append(camera)
        group.append(index)
    return np.array(group)


def judged_lenses(
    cameras: Sequence[Camera],
    pixels: np.ndarray,
    centre_sigma: float,
    rotation_sigma_rad: float,
    factor: float,
    fewest: int,
) -> LensVerdict | None:
    """What tracks (P, N, 2) say of the cameras' lenses; None where the given ones are as good as any.

    The sigmas are those of the poses (``bundle_adjustment.adjusted``); the search begins at ``factor`` times
    the focal lengths. Fewer than ``fewest`` tracks of known depth tell nothing.
    """
    tracks = pixels[:_MOST_TRACKS]
    group = lens_groups(cameras)
    count = int(group.max()) + 1
    begun = {value: intersections([zoomed(camera, value) for camera in cameras], tracks) for value in {1.0, factor}}
    usual = begun[factor]
    kept = usual.known & (np.fmax.reduce(usual.errors_px, axis=1) < _ERRANT_PX)
    if kept.sum() < fewest:
        return None

    def fitted(blocks: Sequence[int], loose: float = 1.0) -> AdjustedLenses:
        free = np.zeros((count, LENS_TERMS), bool)
        free[:, [term for block in blocks for term in _BLOCKS[block]]] = True
        value = factor if 0 in blocks else 1.0
        terms = np.zeros((count, LENS_TERMS))
        terms[:, 0] = np.log(value)
        sigmas = loose * centre_sigma, loose * rotation_sigma_rad
        return adjusted_lenses(cameras, begun[value].points[kept], tracks[kept], *sigmas, group, free, terms)

    every = tuple(range(len(_BLOCKS)))
    poses, whole = fitted(()), fitted(every)
    if _cost(poses) < _CLEARLY_LOWER * _cost(whole):
        return None
    simplest = whole
    for blocks in (some for size in range(1, len(every)) for some in combinations(every, size)):
        tried = fitted(blocks)
        if _cost(tried) <= _AS_GOOD * _cost(whole):
            simplest = tried
            break
    loose = fitted(every, _LOOSE)
    drift = np.abs(loose.terms[:, 0] - whole.terms[:, 0]).max()
    determined = (
        _cost(fitted((), _LOOSE)) >= _CLEARLY_LOWER_OF_LOOSE * _cost(loose)
        and whole.sigma[:, 0].max() < _FOCAL_SIGMA
        and drift < _FOCAL_AGREES
    )
    given_px = begun[1.0].errors_px[kept]
    return LensVerdict(
        simplest.terms,
        bool(determined),
        float(np.nanmedian(given_px)),
        float(np.median(poses.errors_px)),
        float(np.median(simplest.errors_px)),
    )


def _same_lens(a: Camera, b: Camera) -> bool:
    side = max(a.width, a.height)
    near = abs(a.cx - b.cx) < 0.03 * side and abs(a.cy - b.cy) < 0.03 * side
    return (a.width, a.height) == (b.width, b.height) and abs(np.log(a.fx / b.fx)) < 0.03 and near


def _cost(fit: AdjustedLenses) -> float:
    return float(np.log1p((fit.errors_px / _LOSS_PX) ** 2).sum())

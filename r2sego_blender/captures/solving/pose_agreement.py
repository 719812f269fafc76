"""Which photographs' poses contradict the tracks that the others agree on, and where these are instead."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.cameras import Camera
from .intersections import intersections, reprojected
from .pnp import estimate_pose

# Of the points that the others agree on a right pose explains 90 % and more, a wrong one few by chance.
_MIN_AGREEING_SHARE, _RIGHT_SHARE = 0.3, 0.6
# So many matches with the others must contradict a photograph that shares no points with two of them.
_CONTRADICTING_MATCHES = 60
_INLIER_ERROR_PX = 4.0


class Contradiction(NamedTuple):
    """Photograph number ``photograph``, whose given pose the matches contradict.

    ``agreeing`` of the ``shared`` points that the others agree on lie where it saw them. ``camera`` is where
    these are seen from instead, ``located`` how many then agree; None where it is not clear. ``by_pairs``: no two
    others agree on any of the points, so that what repeats in the room may be taken for one thing.
    """

    photograph: int
    agreeing: int
    shared: int
    camera: Camera | None = None
    located: int = 0
    by_pairs: bool = False


class _Shown(NamedTuple):
    """Points (k, 3) that others agree on, and where (k, 2) a photograph saw them."""

    points: np.ndarray
    pixels: np.ndarray

    def agreeing(self, camera: Camera, band_px: float) -> int:
        return int((reprojected([camera], self.points, self.pixels[:, None]) < band_px).sum())


def contradictions(
    cameras: Sequence[Camera], pixels: np.ndarray, band_px: float, min_matches: int, seed: int = 0
) -> list[Contradiction]:
    """The photographs whose poses contradict tracks (P, N, 2), if they are fewer than half of all.

    The worst is set aside first, since it spoils the points by which others are judged; then each is located
    from those that are trusted, by PnP, and trusted again where most of its tracks agree.
    """
    trusted, wrong = set(range(len(cameras))), []
    while True:
        judged = [_judged(index, cameras, pixels, trusted, band_px, min_matches) for index in sorted(trusted)]
        worst = min((one for one in judged if one.shared), key=lambda one: one.agreeing / one.shared, default=None)
        if worst is None or worst.agreeing >= _MIN_AGREEING_SHARE * worst.shared:
            break
        trusted.remove(worst.photograph)
        wrong.append(worst.photograph)
        if 2 * len(wrong) >= len(cameras):
            return []
    placed = list(cameras)
    # What was set aside because of another photograph is trusted again.
    told = {index: _judged(index, placed, pixels, trusted, band_px, min_matches) for index in wrong}
    for index, one in list(told.items()):
        if one.shared and one.agreeing >= _RIGHT_SHARE * one.shared:
            trusted.add(index)
            del told[index]
    waiting = sorted(told, key=lambda index: -told[index].shared)
    for index in waiting:
        shown = _shown(index, placed, pixels, trusted, band_px)
        found = estimate_pose(shown.pixels, shown.points, cameras[index], _INLIER_ERROR_PX, seed)
        if found is None or found.inlier_count < max(min_matches, _RIGHT_SHARE * len(shown.points)):
            continue
        placed[index] = found.camera
        trusted.add(index)
        told[index] = told[index]._replace(camera=found.camera, located=shown.agreeing(found.camera, band_px))
    return [told[index] for index in sorted(told)]


def _judged(
    index: int, cameras: Sequence[Camera], pixels: np.ndarray, trusted: set[int], band_px: float, min_matches: int
) -> Contradiction:
    """How many of what the others agree on agrees with a photograph; of none where too little is shared."""
    shown = _shown(index, cameras, pixels, trusted, band_px)
    if len(shown.points) >= min_matches:
        return Contradiction(index, shown.agreeing(cameras[index], band_px), len(shown.points))
    agreeing = count = 0
    for other in trusted - {index}:
        pair = [other, index]
        rows = np.isfinite(pixels[:, pair, 0]).all(axis=1)
        if rows.any():
            errors = intersections([cameras[k] for k in pair], pixels[rows][:, pair]).errors_px
            agreeing += int((errors.max(axis=1) < band_px).sum())
            count += int(rows.sum())
    return Contradiction(index, agreeing, count if count >= _CONTRADICTING_MATCHES else 0, by_pairs=True)


def _shown(index: int, cameras: Sequence[Camera], pixels: np.ndarray, trusted: set[int], band_px: float) -> _Shown:
    others = sorted(trusted - {index})
    seen = np.isfinite(pixels[..., 0])
    rows = seen[:, index] & (seen[:, others].sum(axis=1) >= 2)
    found = intersections([cameras[k] for k in others], pixels[rows][:, others])
    kept = found.known & (np.fmax.reduce(found.errors_px, axis=1, initial=0.0) < band_px)
    return _Shown(found.points[kept], pixels[rows, index][kept])

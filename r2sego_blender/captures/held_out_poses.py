"""Given poses of held-out photographs, adjusted to what the captures show as the captures' own were.

Poses of one source are wrong in the same way, photograph by photograph. Where those of captures were refined and those
of held-out photographs were not, a sharp picture is compared with one a few pixels beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..config.settings import CaptureSettings
from ..core.cameras import Camera
from ..core.errors import CaptureError
from ..core.progress import SILENT, Progress
from .capture import Capture
from .matching.overlap import Pairs, confirming, match_all, near_pairs
from .pose_adjustment import band_px, clearly_lower, told_of
from .solving.bundle_adjustment import adjusted, reprojection_errors
from .sparse import Detected, detect, triangulate_matches

# The captures' poses were adjusted on import: here they stay.
_OF_CAPTURES = 1e-3
# Poses that matches agree with to so much are as good as refined ones: no picture shows the difference.
_EXACT_PX = 0.25


def adjusted_views(
    views: Sequence[Capture], captures: Sequence[Capture], settings: CaptureSettings, progress: Progress = SILENT
) -> tuple[tuple[Capture, ...], str]:
    """The held-out ``views`` at poses that their matches with the ``captures`` agree with, and what was done to them
    in words, none where nothing was. All are in the world's metres.

    The given poses are priors as the captures' are on import (``pose_adjustment``), and with ``refine_poses`` as "auto"
    kept under the same rule: unless the median reprojection error falls below three quarters of theirs; and where that
    is a quarter of a pixel already. The captures stay as they are. Of a view's photograph nothing is used but where its
    features lie that captures show, too.
    """
    if settings.refine_poses == "never":
        return tuple(views), ""
    first = len(captures)
    cameras: list[Camera] = [one.camera for one in (*captures, *views)]
    detected = detect([*captures, *views], settings, progress)
    try:
        matches = _matches(cameras, first, detected, settings, progress)
        off_px = band_px(cameras, settings)
        pairs = confirming(matches, detected.features, cameras, off_px, settings)
        sparse = triangulate_matches(cameras, detected, pairs, off_px, settings, progress)
    except CaptureError:  # they share too little
        return tuple(views), ""
    free = np.where(np.arange(len(cameras)) < first, _OF_CAPTURES, 1.0)
    sigmas = settings.pose_sigma_m * free, np.radians(settings.pose_sigma_deg) * free
    found, points = adjusted(cameras, sparse.points, sparse.pixels, *sigmas)
    given, better, pixels = cameras[first:], found[first:], sparse.pixels[:, first:]
    measured = np.isfinite(pixels[..., 0])
    if not measured.any():
        return tuple(views), ""
    before_px = float(np.median(reprojection_errors(given, sparse.points, pixels)))
    after_px = float(np.median(reprojection_errors(better, points, pixels)))
    if settings.refine_poses == "auto" and (before_px < _EXACT_PX or not clearly_lower(after_px, before_px)):
        return tuple(views), ""
    told = told_of(int(measured.any(axis=1).sum()), given, better, 1.0, before_px, after_px)
    return tuple(replace(view, camera=at) for view, at in zip(views, better, strict=True)), told


def _matches(
    cameras: Sequence[Camera], first: int, detected: Detected, settings: CaptureSettings, progress: Progress
) -> Pairs:
    """Those of the captures with each other, and of each view, from the ``first`` on, with captures near."""
    captures = cameras[:first]
    among = near_pairs(captures)
    for view in range(first, len(cameras)):
        among += [(i, view) for i, j in near_pairs([*captures, cameras[view]]) if j == first]
    return match_all(detected.features, settings, progress, "Matching held-out photographs", among=among)

"""Given poses of held-out photographs, adjusted to what the captures show as the captures' own were.

Poses of one source are wrong in the same way, photograph by photograph. Where those of captures were refined and those
of held-out photographs were not, a sharp picture is compared with one a few pixels beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..config.settings import CaptureSettings
from ..core.cameras import Camera
from ..core.errors import CaptureError
from ..core.progress import SILENT, Progress
from .capture import Capture
from .matching.overlap import Pairs, match_all, near_pairs
from .pose_adjustment import Adjustment, tracks_near
from .sparse import Detected, detect

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
    cameras: list[Camera] = [one.camera for one in (*captures, *views)]
    detected = detect([*captures, *views], settings, progress)
    try:
        matches = _matches(cameras, len(captures), detected, settings, progress)
        sparse = tracks_near(cameras, detected, matches, settings, progress)
    except CaptureError:  # they share too little
        return tuple(views), ""
    adjustment = Adjustment.of(cameras, sparse, settings, fixed=len(captures))
    kept = adjustment.before_px < _EXACT_PX or not adjustment.clearly_better
    if not adjustment.tracks or (settings.refine_poses == "auto" and kept):
        return tuple(views), ""
    moved = (replace(view, camera=at) for view, at in zip(views, adjustment.cameras, strict=True))
    return tuple(moved), adjustment.told()


def _matches(
    cameras: Sequence[Camera], first: int, detected: Detected, settings: CaptureSettings, progress: Progress
) -> Pairs:
    """Those of the captures with each other, and of each view, from the ``first`` on, with captures near."""
    captures = cameras[:first]
    among = near_pairs(captures)
    for view in range(first, len(cameras)):
        among += [(i, view) for i, j in near_pairs([*captures, cameras[view]]) if j == first]
    return match_all(detected.features, settings, progress, "Matching held-out photographs", among=among)

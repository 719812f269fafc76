"""Weak depth: what two captures agree on although it matches badly.

Reliable depth must look alike in two captures. Fine, repeated or glossy things, and what is
seen at a grazing angle, do not; yet PatchMatch often finds them, for the depth of each
capture is searched on its own and two wrong ones seldom meet in one place with one normal.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ...config.settings import StereoSettings
from .consistency import support
from .evidence import FREE_MARGIN, KnownDepth, collect_votes
from .stereo import DepthMap


def weak_depth(
    depth_maps: Sequence[DepthMap], trusted: Sequence[KnownDepth], settings: StereoSettings
) -> tuple[np.ndarray, ...]:
    """For each map (H, W) float32 planar metres of weak depth, 0 elsewhere.

    Where there is no ``trusted`` depth and another capture's depth agrees at any matching
    cost, no trusted depth sees through it, and the patch is no speckle
    (``settings.min_segment_share`` of the image).
    """
    counts = support(
        [m.camera for m in depth_maps],
        [m.depth for m in depth_maps],
        [m.normal for m in depth_maps],
        [m.depth > 0 for m in depth_maps],
        settings.consistency,
    )
    found = []
    for i, (depth_map, count, view) in enumerate(zip(depth_maps, counts, trusted, strict=True)):
        agreed = (count > 0) & (view.depth == 0)
        points = depth_map.camera.unproject(depth_map.depth)[agreed]
        others = [other for j, other in enumerate(trusted) if j != i]
        agreed[agreed] = collect_votes(points, others, FREE_MARGIN).through == 0
        _, patch, sizes, _ = cv2.connectedComponentsWithStats(agreed.astype(np.uint8), connectivity=4)
        agreed &= sizes[patch, cv2.CC_STAT_AREA] >= settings.min_segment_share * agreed.size
        found.append(np.where(agreed, depth_map.depth, 0).astype(np.float32))
    return tuple(found)

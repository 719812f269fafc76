"""Which masks of different photographs show one thing: those that share observed points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...core.cameras import Camera
from ..stereo.observed_geometry import ObservedGeometry

_LEAST_SHARED = 20  # points
_LEAST_OVERLAP = 0.5  # of the points of either mask that the other's photograph sees


def joined_masks(
    masks: Sequence[np.ndarray],
    views: Sequence[int],
    labels: Sequence[str],
    cameras: Sequence[Camera],
    observed: ObservedGeometry,
) -> list[list[int]]:
    """Groups of indices of ``masks`` (H, W) bool, each one thing; larger groups first.

    Mask m lies in the photograph of ``cameras[views[m]]`` and is called ``labels[m]``. Masks are
    joined, those that share most first, if they have one name, and a thing is once in a photograph.
    """
    inside, seen = _points(masks, views, cameras, observed)
    pairs = []
    for a in range(len(masks)):
        for b in range(a):
            if views[a] == views[b] or labels[a] != labels[b]:
                continue
            shared = int((inside[a] & inside[b]).sum())
            either = min((inside[a] & seen[views[b]]).sum(), (inside[b] & seen[views[a]]).sum())
            if shared >= _LEAST_SHARED and shared >= _LEAST_OVERLAP * either:
                pairs.append((-shared / either, b, a))
    group = list(range(len(masks)))
    for _, a, b in sorted(pairs):
        one, other = ([m for m in range(len(masks)) if group[m] == group[k]] for k in (a, b))
        if group[a] != group[b] and not {views[m] for m in one} & {views[m] for m in other}:
            for m in other:
                group[m] = group[a]
    found = [[m for m in range(len(masks)) if group[m] == number] for number in sorted(set(group))]
    return sorted(found, key=lambda members: (-len(members), members))


def _points(
    masks: Sequence[np.ndarray], views: Sequence[int], cameras: Sequence[Camera], observed: ObservedGeometry
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """(P,) bool of each mask, the points it shows, and of each camera, those it sees."""
    pixels, seen = [], []
    for k, camera in enumerate(cameras):
        places, depth = camera.project(observed.points)
        visible = camera.sees(places, depth) & observed.visibility[:, k]
        pixels.append(np.where(visible[:, None], places, 0).astype(np.int64))
        seen.append(visible)
    inside = [
        seen[view] & mask[pixels[view][:, 1], pixels[view][:, 0]] for mask, view in zip(masks, views, strict=True)
    ]
    return inside, seen

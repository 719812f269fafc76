"""What a list of captures says of each: its size, its lens, and how far it overlaps others. No bpy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...captures.sparse_points import SPARSE
from ...core.errors import SceneError
from .bundle import Bundle

_ENOUGH_SHARED = 15
"""Points two captures must both have measured to count as overlapping."""

_MOST_POINTS = 20_000
"""Overlaps are counted on this many points at most; a sample of more tells no more."""


@dataclass(frozen=True)
class ListedCapture:
    """A capture's line: its size and horizontal field of view, and what it measured.

    ``points``: sparse points it measured; ``overlaps``: captures that measured enough of the
    same ones. Both are 0 where the bundle has no sparse points.
    """

    name: str
    width: int
    height: int
    view_deg: float
    points: int
    overlaps: int


def listed_captures(bundle: Bundle) -> list[ListedCapture]:
    """The captures of a bundle in their order. Raises SceneError when its files are damaged."""
    views = bundle.captures()
    points, overlaps = _measured(bundle, len(views))
    return [
        ListedCapture(
            view.name,
            view.camera.width,
            view.camera.height,
            horizontal_view_deg(view.camera.width, view.camera.fx, view.camera.cx),
            int(points[index]),
            int(overlaps[index]),
        )
        for index, view in enumerate(views)
    ]


def horizontal_view_deg(width: int, fx: float, cx: float) -> float:
    """The angle between the rays through the middles of the left and right edges, degrees."""
    return float(np.degrees(np.arctan2(cx, fx) + np.arctan2(width - cx, fx)))


def overlap_counts(visibility: np.ndarray) -> np.ndarray:
    """(N,) int: how many other captures share enough points; ``visibility`` (P, N) bool."""
    step = max(1, -(-len(visibility) // _MOST_POINTS))
    sampled = visibility[::step].astype(np.float32)
    shared = sampled.T @ sampled * step >= _ENOUGH_SHARED
    np.fill_diagonal(shared, False)
    return shared.sum(axis=1)


def _measured(bundle: Bundle, count: int) -> tuple[np.ndarray, np.ndarray]:
    file = bundle.sparse_file
    if not file.is_file():
        return np.zeros(count, int), np.zeros(count, int)
    visibility = bundle.read(SPARSE).visibility
    if visibility.shape[1] != count:
        raise SceneError(
            f"its points were measured in {visibility.shape[1]} captures, there are {count}",
            where=file,
            cure="Import the captures again.",
        )
    return visibility.sum(axis=0), overlap_counts(visibility)

"""Which observed points lie on an object, by its masks. NumPy alone: Blender asks too."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...core.cameras import Camera
from ..visibility.point_visibility import looked_up


def points_on_object(
    points: np.ndarray,
    visibility: np.ndarray,
    cameras: Sequence[Camera],
    masks: Sequence[np.ndarray],
    indices: Sequence[int],
) -> np.ndarray:
    """(P,) bool: the observed ``points`` (P, 3) that most captures that see them show in their masks.

    ``visibility`` (P, N) bool; ``indices`` are the captures of ``cameras`` and ``masks`` among N.
    """
    inside, seen = np.zeros(len(points)), np.zeros(len(points))
    for k, camera, mask in zip(indices, cameras, masks, strict=True):
        in_view, _, shown = looked_up(points, camera, mask)
        seen[in_view] += visibility[in_view, k]
        inside[in_view] += shown * visibility[in_view, k]
    return 2 * inside > seen

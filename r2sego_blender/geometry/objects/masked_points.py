"""Which observed points lie on an object, by its masks. NumPy alone: Blender asks too."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...core.cameras import Camera


def points_on_object(
    points: np.ndarray, visibility: np.ndarray, cameras: Sequence[Camera], masks: Sequence[np.ndarray],
    indices: Sequence[int],
) -> np.ndarray:  # fmt: skip
    """(P,) bool: the observed ``points`` (P, 3) that most captures that see them show in their masks.

    ``visibility`` (P, N) bool; ``indices`` are the captures of ``cameras`` and ``masks`` among N.
    """
    inside, seen = np.zeros(len(points)), np.zeros(len(points))
    for k, camera, mask in zip(indices, cameras, masks, strict=True):
        pixels, depth = camera.project(points)
        visible = camera.sees(pixels, depth) & visibility[:, k]
        columns, rows = pixels[visible].astype(np.int64).T
        inside[visible] += mask[rows, columns]
        seen[visible] += 1
    return 2 * inside > seen

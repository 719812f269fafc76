"""Captures that show less sharply what others show as well: they count less, and are named."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ..core.images import at_pixels
from ..core.progress import Progress
from .capture import Capture
from .sparse_points import SparsePoints

_WINDOW_PX = 15
_FEWEST_POINTS = 30
# Nearer captures show texture larger and so less sharply: only those that see a point about as finely are compared.
_FOOTPRINTS = 1.25
BLURRED = 0.25
"""Relative sharpness below which a capture is blurred; a pixel of blur leaves less, other places half at worst."""

_LEAST_WEIGHT = 0.1


def relative_sharpness(captures: Sequence[Capture], sparse: SparsePoints) -> np.ndarray:
    """(N,): how sharply each capture shows the points that it shares, over the others' median; 1 where unknown.

    Sharpness is the energy of the Laplacian around a point over that of the brightness, so that exposure
    cancels.
    """
    energy = np.full(sparse.visibility.shape, np.nan)
    footprint = np.full(sparse.visibility.shape, np.nan)
    for index, capture in enumerate(captures):
        seen = np.flatnonzero(sparse.visibility[:, index])
        if not len(seen):
            continue
        grey = cv2.cvtColor(capture.as_taken(), cv2.COLOR_RGB2GRAY)
        window = (_WINDOW_PX, _WINDOW_PX)
        laplacian = cv2.blur(cv2.Laplacian(grey, cv2.CV_32F) ** 2, window)
        brightness = cv2.blur(grey, window) ** 2 + 1e-4
        energy[seen, index] = np.log(at_pixels(laplacian / brightness, sparse.pixels[seen, index]) + 1e-7)
        _, depth = capture.camera.project(sparse.points[seen])
        footprint[seen, index] = np.log(np.maximum(depth, 1e-6) / capture.camera.fx)
    sharpness = np.ones(len(captures))
    for index in range(len(captures)):
        comparable = np.abs(footprint - footprint[:, [index]]) < np.log(_FOOTPRINTS)
        comparable[:, index] = False
        points = np.flatnonzero(comparable.any(axis=1))
        if len(points) >= _FEWEST_POINTS:
            others = np.nanmedian(np.where(comparable[points], energy[points], np.nan), axis=1)
            sharpness[index] = np.exp(np.median(energy[points, index] - others))
    return sharpness


def weights_of(names: Sequence[str], sharpness: np.ndarray, progress: Progress) -> list[float]:
    """How much each capture counts: exactly 1, and less for those that are blurred, which are named in a warning."""
    weights = [1.0 if one >= BLURRED else float(round(max(one / BLURRED, _LEAST_WEIGHT), 3)) for one in sharpness]
    blurred = [
        f"{name} ({one:.0%})" for name, one, weight in zip(names, sharpness, weights, strict=True) if weight < 1.0
    ]
    if blurred:
        progress.message(
            f"blurred: {', '.join(blurred)} of the sharpness with which other photographs show the same. They count "
            "less in blending and training; photograph again from those places, holding still",
            "warning",
        )
    return weights

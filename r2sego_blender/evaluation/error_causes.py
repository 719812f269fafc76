"""Why a rendered view is wrong: its squared error split by what is known of the true room.

Each pixel has one cause, the first that holds: *wrong depth* (the proxy is not where the
room is), *never seen* (no capture sees that point), *edges* (near a true depth edge), and
*appearance* for all others (resampling, shading that depends on the view, exposure).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ..core.cameras import Camera
from ..generation.generators.visibility import depth_edges
from .surfaces.regions import seen_by_captures

CAUSES = ("wrong_depth", "never_seen", "edges", "appearance")

_WRONG_DEPTH = 0.03  # relative
_EDGE_JUMP = 0.03
EDGE_PX = 2
"""Pixels this near a depth edge count as edges."""


@dataclass(frozen=True)
class CauseShares:
    """What one cause has of some views.

    ``pixels`` and ``error`` are its shares, in [0, 1], of all pixels and of the sum of
    squared errors; ``psnr`` is that of its pixels alone, None where there are none.
    """

    pixels: float
    error: float
    psnr: float | None


def causes(
    camera: Camera,
    depth: np.ndarray,
    true_depth: np.ndarray,
    capture_cameras: Sequence[Camera],
    capture_true_depths: Sequence[np.ndarray],
) -> np.ndarray:
    """(H, W) uint8, an index of ``CAUSES`` for each pixel of the view.

    ``depth`` is the proxy's and ``true_depth`` the room's planar z (H, W) in metres, 0
    where there is nothing; the captures' true depths are (H, W) of their cameras.
    """
    wrong = np.abs(depth - true_depth) > _WRONG_DEPTH * true_depth
    seen = seen_by_captures(camera, true_depth, capture_cameras, capture_true_depths)
    edges = near_edges(true_depth)
    return np.select([wrong, ~seen, edges], [0, 1, 2], 3).astype(np.uint8)


def near_edges(depth: np.ndarray) -> np.ndarray:
    """(H, W) bool: the pixels within 2 px of an edge of a planar depth map (H, W)."""
    near, far = depth_edges(depth, _EDGE_JUMP)
    square = np.ones((2 * EDGE_PX + 1, 2 * EDGE_PX + 1), np.uint8)
    return cv2.dilate((near | far).astype(np.uint8), square) > 0


def split(
    images: Sequence[np.ndarray],
    truths: Sequence[np.ndarray],
    labels: Sequence[np.ndarray],
    names: Sequence[str] = CAUSES,
) -> dict[str, CauseShares]:
    """Each cause's shares over all views; images and truths (H, W, 3), labels (H, W) of ``names``."""
    pixels, errors = np.zeros(len(names)), np.zeros(len(names))
    for image, truth, label in zip(images, truths, labels, strict=True):
        squared = np.mean((image.astype(np.float64) - truth) ** 2, axis=-1)
        pixels += np.bincount(label.ravel(), minlength=len(names))
        errors += np.bincount(label.ravel(), squared.ravel(), minlength=len(names))
    return {
        name: CauseShares(
            pixels=float(count / pixels.sum()),
            error=float(error / max(errors.sum(), np.finfo(float).tiny)),
            psnr=float(-10.0 * np.log10(max(error / count, 1e-10))) if count else None,
        )
        for name, count, error in zip(names, pixels, errors, strict=True)
    }

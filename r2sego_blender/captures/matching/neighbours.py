"""Which other captures each capture is matched against."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...core.cameras import Camera

# The angle between two rays at a point that serves stereo best, and how fast the score
# falls below and above it (MVSNet's piecewise Gaussian: 5, 1 and 10 degrees; wider here,
# since captures of a room are few and lie far apart).
_BEST_ANGLE_DEG = 8.0
_SPREAD_BELOW_DEG = 4.0
_SPREAD_ABOVE_DEG = 22.0


def neighbours(
    cameras: Sequence[Camera], points: np.ndarray, count: int, visibility: np.ndarray | None = None
) -> tuple[tuple[int, ...], ...]:
    """For each camera the up to ``count`` others that share most points at good angles.

    ``points`` (P, 3) world, metres; ``visibility`` (P, N) bool says which cameras see each
    of them, and without it those count whose image a point projects into. Best first, ties
    by index; a camera that shares no point with another never has it.
    """
    if visibility is None:
        visibility = np.stack([camera.sees(*camera.project(points)) for camera in cameras], axis=1)
    centres = np.array([camera.centre for camera in cameras])
    chosen = []
    for i in range(len(cameras)):
        # What a camera does not see, it shares with none.
        seen = np.flatnonzero(visibility[:, i])
        row, other = np.nonzero(visibility[seen])
        shared = points[seen]
        own, others = _directions(centres[i] - shared)[row], _directions(centres[other] - shared[row])
        angle_deg = np.degrees(np.arccos(np.einsum("mc,mc->m", own, others).clip(-1.0, 1.0)))
        spread = np.where(angle_deg < _BEST_ANGLE_DEG, _SPREAD_BELOW_DEG, _SPREAD_ABOVE_DEG)
        scores = np.exp(-0.5 * ((angle_deg - _BEST_ANGLE_DEG) / spread) ** 2)
        score = np.bincount(other, scores, len(cameras))
        score[i] = 0.0
        ranked = np.argsort(-score, kind="stable")[:count]
        chosen.append(tuple(int(j) for j in ranked if score[j] > 0.0))
    return tuple(chosen)


def _directions(vectors: np.ndarray) -> np.ndarray:
    """Vectors (n, 3) of length 1; those of no length stay so."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True).clip(1e-12)

"""Sparse points: what the captures triangulated, and which of them saw each. NumPy alone.

The first, sparse part of the paper's fragmentary geometry ``M_obs = (P_obs, A_obs)``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from ..bundle import layout
from ..bundle.artifacts import Artifact
from ..core.arrays import opened_arrays, require_between, require_shapes, save_arrays
from ..core.errors import CaptureError

FARTHEST_M = 1e9
"""Of a point from the origin, metres: where the rays to it are all but parallel it may lie far off."""


@dataclass(frozen=True)
class SparsePoints:
    """Triangulated points with their support record.

    ``points`` (P, 3) float64; ``colours`` (P, 3) uint8; ``visibility`` (P, N) bool, the
    captures that measured each point (A_obs); ``error_px`` (P,) float64, mean reprojection
    error; ``pixels`` (P, N, 2) float32, where each capture measured it, NaN elsewhere.
    """

    points: np.ndarray
    colours: np.ndarray
    visibility: np.ndarray
    error_px: np.ndarray
    pixels: np.ndarray

    @staticmethod
    def none(captures: int) -> SparsePoints:
        """No point, of so many captures that measured nothing."""
        return SparsePoints(
            np.zeros((0, 3)),
            np.zeros((0, 3), np.uint8),
            np.zeros((0, captures), bool),
            np.zeros(0),
            np.zeros((0, captures, 2), np.float32),
        )

    def transformed(self, similarity: np.ndarray) -> SparsePoints:
        """These points after a (4, 4) similarity of the world."""
        return replace(self, points=self.points @ similarity[:3, :3].T + similarity[:3, 3])

    def widest_sine(self, centres: Sequence[np.ndarray]) -> np.ndarray:
        """(P,) sine of the widest angle between two rays that measured a point, of the captures' ``centres``."""
        rays = self.points[:, None] - np.array(centres)
        rays /= np.maximum(np.linalg.norm(rays, axis=2, keepdims=True), 1e-12)
        widest = np.ones(len(self.points))
        for index in range(len(centres)):
            cosine = np.einsum("pnc,pc->pn", rays, rays[:, index])
            both = self.visibility & self.visibility[:, index : index + 1]
            widest = np.minimum(widest, np.where(both, cosine, 1.0).min(axis=1))
        return np.sqrt(np.clip(1.0 - np.clip(widest, 0.0, 1.0) ** 2, 0.0, 1.0))

    def save(self, path: Path) -> None:
        """Write the arrays as an uncompressed ``.npz``."""
        save_arrays(path, **{field.name: getattr(self, field.name) for field in fields(self)})

    @staticmethod
    def load(path: Path) -> SparsePoints:
        """Read what ``save`` wrote. Raises CaptureError when the file is none of it."""
        cure = "Make the scene anew with `r2sego new`."
        with opened_arrays(path, CaptureError, "these are no sparse points", cure) as data:
            arrays = {field.name: data[field.name] for field in fields(SparsePoints)}
            require_shapes(arrays, points="P 3", colours="P 3", visibility="P N", error_px="P", pixels="P N 2")
            require_between(-FARTHEST_M, FARTHEST_M, points=arrays["points"])
            require_between(0.0, FARTHEST_M, error_px=arrays["error_px"])
            if arrays["visibility"].dtype != np.bool_ or arrays["colours"].dtype != np.uint8:
                raise ValueError("visibility or colours are of another kind")
            places = arrays["pixels"][..., 0] + arrays["pixels"][..., 1]
            if not (np.isfinite(places) >= arrays["visibility"]).all():
                raise ValueError("a capture that measured a point says nowhere where")
            return SparsePoints(**arrays)


SPARSE = Artifact(layout.SPARSE, SparsePoints.load, part_of=layout.CAPTURES)
"""The points triangulated from the captures."""

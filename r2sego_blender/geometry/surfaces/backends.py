"""Surface backends: weighted depth maps in, the complement's surface out.

``proxy.surface`` names one. The two embedded ones need nothing; NKSR, the paper's, runs in
an environment of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from ...core.arrays import opened_arrays, save_arrays
from ...core.errors import GeometryError
from ...core.scratch import ScratchFolder
from ...workers.nksr import reconstruct_elsewhere
from .oriented_points import OrientedPoints, WeightedDepth
from .poisson import checked, poisson_surface
from .tsdf import DistanceField


class SurfaceBackend(Protocol):
    """What a backend does: ``views`` give vertices (V, 3) float64 in the world and faces
    (F, 3) int32, counter-clockwise from the free side.

    ``field`` is empty and says where to look and how finely: its box, ``voxel_m`` and
    ``truncation_m``. Empty arrays where there is no surface; GeometryError, NativeError or
    MachineError where none can be made.
    """

    def __call__(
        self, views: Sequence[WeightedDepth], field: DistanceField
    ) -> tuple[np.ndarray, np.ndarray]: ...


def fused_surface(views: Sequence[WeightedDepth], field: DistanceField) -> tuple[np.ndarray, np.ndarray]:
    """The zero level of the truncated distances of all views, fused in ``field``."""
    for view in views:
        field.integrate(view.camera, view.depth, view.weight)
    return field.surface()


def screened_poisson_surface(
    views: Sequence[WeightedDepth], field: DistanceField
) -> tuple[np.ndarray, np.ndarray]:
    """Screened Poisson reconstruction of the views' oriented points, trimmed where there are none."""
    return poisson_surface(_cloud(views, field), field.voxel_m)


def nksr_surface(views: Sequence[WeightedDepth], field: DistanceField) -> tuple[np.ndarray, np.ndarray]:
    """NKSR's surface of the views' oriented points; see ``workers.nksr`` for what it needs."""
    points, normals = checked(_cloud(views, field))
    with ScratchFolder() as folder:
        cloud, surface = Path(folder, "cloud.npz"), Path(folder, "surface.npz")
        save_arrays(cloud, points=points, normals=normals)
        reconstruct_elsewhere(cloud, surface, field.voxel_m)
        with opened_arrays(surface, GeometryError, "NKSR left no surface") as data:
            return data["vertices"].astype(np.float64), data["faces"].astype(np.int32)


SURFACES: Mapping[str, SurfaceBackend] = {
    "tsdf": fused_surface,
    "poisson": screened_poisson_surface,
    "nksr": nksr_surface,
}
"""The backends by the names that ``proxy.surface`` may have."""


def _cloud(views: Sequence[WeightedDepth], field: DistanceField) -> OrientedPoints:
    high = field.origin + (np.array(field.distance.shape) - 1) * field.voxel_m
    return OrientedPoints.of(views, field.origin, high, field.voxel_m, field.truncation_m)

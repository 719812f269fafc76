"""NKSR, the paper's surface reconstructor; ``workers.nksr`` says what it needs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...core.arrays import opened_arrays, save_arrays
from ...core.errors import GeometryError
from ...core.scratch import ScratchFolder
from ...workers.nksr import reconstruct_externally
from .backends import cloud_of
from .oriented_points import WeightedDepth
from .poisson import checked
from .tsdf import DistanceField

BACKENDS = {"nksr": "NKSR"}
ORDER = 2


def surface(views: Sequence[WeightedDepth], field: DistanceField) -> tuple[np.ndarray, np.ndarray]:
    """NKSR's surface of the views' oriented points."""
    points, normals = checked(cloud_of(views, field))
    with ScratchFolder() as folder:
        cloud, made = Path(folder, "cloud.npz"), Path(folder, "surface.npz")
        save_arrays(cloud, points=points, normals=normals)
        reconstruct_externally(cloud, made, field.voxel_m)
        with opened_arrays(made, GeometryError, "NKSR left no surface") as data:
            return data["vertices"].astype(np.float64), data["faces"].astype(np.int32)

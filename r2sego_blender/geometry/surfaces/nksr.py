"""NKSR, the paper's surface reconstructor; ``workers.nksr`` says what it needs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

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
    vertices, faces = reconstruct_externally(points, normals, field.voxel_m)
    return vertices.astype(np.float64), faces.astype(np.int32)

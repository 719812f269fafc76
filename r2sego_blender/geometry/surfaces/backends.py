"""The slot of the surface reconstructor: weighted depth maps in, the complement's surface out.

A backend is a file of this folder with ``BACKENDS``, its names in ``proxy.surface`` (``config.slots``), and a
function ``surface``; nothing else has to know of it.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from typing import Protocol, cast

import numpy as np

from ...config.slots import SURFACES
from .oriented_points import OrientedPoints, WeightedDepth
from .tsdf import DistanceField


class SurfaceBackend(Protocol):
    """A file of this folder."""

    BACKENDS: Mapping[str, str]

    def surface(self, views: Sequence[WeightedDepth], field: DistanceField) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (V, 3) float64 in the world and faces (F, 3) int32, counter-clockwise from the free side.

        ``field`` is empty and says where to look and how finely: its box, ``voxel_m`` and
        ``truncation_m``. Empty arrays where there is no surface; GeometryError, NativeError or
        MachineError where none can be made.
        """
        ...


def surface_backend(name: str) -> SurfaceBackend:
    """The backend that ``proxy.surface`` calls ``name``."""
    return cast(SurfaceBackend, importlib.import_module(f".{SURFACES.module(name)}", __package__))


def cloud_of(views: Sequence[WeightedDepth], field: DistanceField) -> OrientedPoints:
    """The views' oriented points within the field's box, one a voxel."""
    high = field.origin + (np.array(field.distance.shape) - 1) * field.voxel_m
    return OrientedPoints.of(views, field.origin, high, field.voxel_m, field.truncation_m)

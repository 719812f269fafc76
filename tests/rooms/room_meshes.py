"""Closed rooms as meshes, and meshes as proxies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from r2sego_blender.geometry.proxy.proxy import GeometryProxy


def closed_room(size_m: Sequence[float], *boxes: tuple[ArrayLike, ArrayLike]) -> trimesh.Trimesh:
    """A room on the floor around the origin with boxes (lowest, highest corner); faces face free space."""
    shell = trimesh.creation.box(size_m)
    shell.apply_translation((0, 0, size_m[2] / 2))
    shell.invert()
    return trimesh.util.concatenate([shell, *(trimesh.creation.box(bounds=box) for box in boxes)])


def observed_proxy(vertices: ArrayLike, faces: ArrayLike, support: ArrayLike = 1) -> GeometryProxy:
    """Vertices (V, 3) and faces (F, 3) as a proxy that ``support`` captures observed, with all confidence."""
    count = len(faces)
    return GeometryProxy(
        np.asarray(vertices, np.float32),
        np.asarray(faces, np.int32),
        np.zeros(count, np.uint8),
        np.broadcast_to(support, count).astype(np.uint16),
        np.ones(count, np.float32),
    )

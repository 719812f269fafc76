"""Screened Poisson surface reconstruction (Kazhdan and Hoppe, 2013), COLMAP's own build of it.

The native code ends the process on clouds it does not like, sometimes with status 0, so
clouds are looked at first and the reconstruction runs in a child process.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from ...core.errors import GeometryError
from ...core.scratch import ScratchFolder
from ...workers.child import call_in_child
from ..mesh.meshes import compacted
from .backends import cloud_of
from .oriented_points import OrientedPoints, WeightedDepth
from .tsdf import DistanceField

BACKENDS = {"poisson": "embedded: screened Poisson of completed depth"}
ORDER = 1

_CLOUD, _SURFACE = "points.ply", "surface.ply"
_FEWEST_POINTS = 50
_DEPTHS = (4, 10)  # of the octree; a side is cut into 2**depth cells
_PADDING = 1.1  # the octree's side over the cloud's
_TRIMMED_CELLS = 2.0  # surface farther than this from every point is invented


def surface(views: Sequence[WeightedDepth], field: DistanceField) -> tuple[np.ndarray, np.ndarray]:
    """Screened Poisson reconstruction of the views' oriented points, trimmed where there are none."""
    return poisson_surface(cloud_of(views, field), field.voxel_m)


def poisson_surface(cloud: OrientedPoints, cell_m: float) -> tuple[np.ndarray, np.ndarray]:
    """The cloud's surface in cells of about ``cell_m``, where there are points near.

    Vertices (V, 3) float64 and faces (F, 3) int32, counter-clockwise from the side the
    normals point to. Raises GeometryError for a cloud that no surface can come of, and
    NativeError when the reconstruction fails.
    """
    points, normals = checked(cloud)
    extent = float(np.ptp(points, axis=0).max())
    depth = int(np.clip(round(np.log2(_PADDING * extent / cell_m)), *_DEPTHS))
    with ScratchFolder() as folder:
        _write_ply(Path(folder, _CLOUD), points, normals)
        call_in_child(_reconstruct, {"folder": folder, "depth": depth})
        mesh: Any = trimesh.load(Path(folder, _SURFACE), process=False, force="mesh")
        vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int32)
    reach = max(_TRIMMED_CELLS * cell_m, 1.5 * _PADDING * extent / 2**depth)
    near = np.isfinite(cKDTree(points).query(vertices, distance_upper_bound=reach)[0])
    return compacted(vertices, faces[near[faces].all(1)])


def checked(cloud: OrientedPoints) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals (P, 3) float32 that native code can stand.

    Raises GeometryError for a cloud that is empty, tiny, all in one place or a line, not
    finite, or without normals.
    """
    points, normals = (np.asarray(v, np.float32) for v in (cloud.points, cloud.normals))
    wrong = None
    if points.ndim != 2 or points.shape[1:] != (3,) or points.shape != normals.shape:
        wrong = "points and normals are not one (P, 3) each"
    elif not (np.isfinite(points).all() and np.isfinite(normals).all()):
        wrong = "it has values that are not finite"
    elif len(points) < _FEWEST_POINTS:
        wrong = f"it has {len(points)} points"
    elif (np.abs(np.linalg.norm(normals, axis=1) - 1.0) > 0.1).any():
        wrong = "it has points without a normal"
    else:
        spread = np.linalg.svd((points - points.mean(0)).astype(np.float64), compute_uv=False)
        if spread[1] < 1e-4 * max(1.0, spread[0]):
            wrong = "its points lie on a line, or all in one place"
    if wrong is not None:
        raise GeometryError(
            f"no surface can come of this cloud: {wrong}",
            where="surface",
            cure="Take more photographs that overlap, or check their poses.",
        )
    return points, normals


def _write_ply(path: Path, points: np.ndarray, normals: np.ndarray) -> None:
    names = ("x", "y", "z", "nx", "ny", "nz")
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    header += [f"property float {name}" for name in names] + ["end_header", ""]
    data = np.concatenate([points, normals], axis=1).astype("<f4")
    path.write_bytes("\n".join(header).encode() + data.tobytes())


def _reconstruct(request: dict) -> dict:
    """Runs in the child: makes the surface of the cloud in ``folder``."""
    import pycolmap

    os.chdir(request["folder"])  # Windows' COLMAP opens no path of letters beyond the system's,
    os.environ |= {"TEMP": ".", "TMP": "."}  # nor do its own temporary files
    options = pycolmap.PoissonMeshingOptions()
    options.depth, options.trim, options.color = request["depth"], 0.0, False
    options.num_threads = 1  # the same bits every time
    pycolmap.poisson_meshing(_CLOUD, _SURFACE, options)
    if not Path(_SURFACE).is_file() or not Path(_SURFACE).stat().st_size:
        raise GeometryError("the reconstruction left no surface", where="surface", cure="Use another backend.")
    return {}

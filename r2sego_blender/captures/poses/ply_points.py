"""Points of a PLY file: positions and colours alone."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import CaptureError
from ...core.text_files import read_bytes
from ...splats.harmonics import SH_BAND_0

_GREY = 128
_MOST_BYTES = 1 << 30
_HARMONICS = ("f_dc_0", "f_dc_1", "f_dc_2")


def read_ply_points(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """The vertices (P, 3) float64 of a PLY and their colours (P, 3) uint8, grey where it has none; of Gaussian splats
    those of every direction.

    Raises CaptureError when the file is missing or holds no point.
    """
    import trimesh

    try:
        data = io.BytesIO(read_bytes(path, _MOST_BYTES))
        # Without materials: a picture that the file names would be opened, or be a pipe that never ends.
        cloud: Any = trimesh.load(data, file_type="ply", process=False, skip_materials=True)
        xyz = np.asarray(cloud.vertices, np.float64).reshape(-1, 3)
    except Exception as error:  # trimesh raises whatever its parser ran into
        raise CaptureError("the points cannot be read", where=path, cure="Give a PLY file with vertices.") from error
    colours = getattr(cloud, "colors", None) if isinstance(cloud, trimesh.PointCloud) else None
    if colours is None and cloud.visual.kind == "vertex":
        colours = cloud.visual.vertex_colors
    if colours is None or len(colours) != len(xyz) or np.ndim(colours) != 2 or np.shape(colours)[1] < 3:
        colours = _of_splats(cloud)
    if colours is None:
        colours = np.full((len(xyz), 3), _GREY)
    return _finite(xyz, np.asarray(colours, np.uint8)[:, :3], path)


def _of_splats(cloud: Any) -> np.ndarray | None:
    """(P, 3) uint8, the first of the spherical harmonics as 3DGS calls them; None where the vertices have none."""
    vertices = cloud.metadata.get("_ply_raw", {}).get("vertex", {}).get("data")
    if not isinstance(vertices, np.ndarray) or not set(_HARMONICS) <= set(vertices.dtype.names or ()):
        return None
    coefficients = np.stack([vertices[name] for name in _HARMONICS], axis=1).astype(np.float64)
    shades = np.nan_to_num(255.0 * (0.5 + SH_BAND_0 * coefficients), nan=_GREY)
    return np.rint(shades).clip(0, 255).astype(np.uint8)


def _finite(xyz: np.ndarray, colours: np.ndarray, path: Path) -> tuple[np.ndarray, np.ndarray]:
    kept = np.isfinite(xyz).all(axis=1)
    if not kept.any():
        raise CaptureError("there is no point in the file", where=path, cure="Give one with points.")
    return xyz[kept], colours[kept]

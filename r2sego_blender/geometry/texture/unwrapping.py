"""Texture coordinates for a mesh: xatlas within a time limit, else boxes.

xatlas takes seconds for ten thousand faces and for some meshes forever, so it runs in a
child process. When its time is up a mesh of half the faces gets the rest of it; when that
is not enough either, or xatlas fails, faces are projected along the axis they look along,
which always ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...config.settings import TextureSettings
from ...core.arrays import opened_arrays, save_arrays
from ...core.errors import GeometryError, NativeError
from ...core.progress import SILENT, Progress
from ...core.scratch import ScratchFolder
from ...workers.child import call_in_child
from ..mesh.decimation import decimated, welded
from .box_unwrapping import box_unwrapped

_FIRST_SHARE = 0.6  # of the time, for the mesh as it is


@dataclass(frozen=True)
class UnwrappedMesh:
    """``vertices`` (V, 3) float32, split where charts part, ``faces`` (F, 3) int32 and
    ``uvs`` (V, 2) float32 in [0, 1], v downwards; ``method`` says how they were found."""

    vertices: np.ndarray
    faces: np.ndarray
    uvs: np.ndarray
    method: str


def unwrapped(
    vertices: np.ndarray, faces: np.ndarray, settings: TextureSettings, progress: Progress = SILENT
) -> UnwrappedMesh:
    """Charts without overlaps for a texture of ``size_px`` in about ``unwrap_seconds`` at most.

    Raises GeometryError for a mesh that is damaged, or has more charts than texels.
    """
    vertices, faces = welded(vertices, faces)
    for fewer, share in ((1, _FIRST_SHARE), (2, 1 - _FIRST_SHARE)):
        mesh = decimated(vertices, faces, max(len(faces) // fewer, 4))
        method = "xatlas" if fewer == 1 else f"xatlas, with {len(mesh[1])} faces for want of time"
        try:
            return UnwrappedMesh(*_by_xatlas(*mesh, settings, share * settings.unwrap_seconds), method)
        except NativeError as error:
            progress.message(f"unwrapping {len(mesh[1])} faces: {error.what}", "warning")
    boxes = box_unwrapped(vertices, faces, settings.size_px, settings.padding_px)
    return UnwrappedMesh(*boxes, "boxes, since xatlas gave no charts")


def _by_xatlas(
    vertices: np.ndarray, faces: np.ndarray, settings: TextureSettings, seconds: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    with ScratchFolder() as folder:
        mesh, charts = Path(folder, "mesh.npz"), Path(folder, "charts.npz")
        save_arrays(mesh, vertices=vertices, faces=faces)
        request = {
            "mesh": str(mesh),
            "charts": str(charts),
            "size_px": settings.size_px,
            "padding_px": settings.padding_px,
        }
        call_in_child(_run_xatlas, request, timeout_s=seconds)
        with opened_arrays(charts, GeometryError, "xatlas left no charts") as data:
            source, faces, uvs = data["source"], data["faces"], data["uvs"]
    return vertices[source], faces, uvs


def _run_xatlas(request: dict) -> dict:
    """Runs in the child."""
    import xatlas

    with np.load(request["mesh"]) as data:
        vertices, faces = data["vertices"], data["faces"]
    charts, packing = xatlas.ChartOptions(), xatlas.PackOptions()
    charts.max_iterations = 1  # more take three times as long and save few seams
    packing.resolution, packing.padding, packing.bilinear = request["size_px"], request["padding_px"], True
    packing.create_image = False
    atlas = xatlas.Atlas()
    atlas.add_mesh(vertices.astype(np.float32), faces.astype(np.uint32))
    atlas.generate(charts, packing)
    source, faces, uvs = atlas[0]
    # The atlas comes out near the size asked for and not quite square; texels stay square.
    uvs = uvs * np.array([atlas.width, atlas.height], np.float32) / np.float32(max(atlas.width, atlas.height))
    np.savez(
        request["charts"],
        source=source.astype(np.int64),
        faces=faces.astype(np.int32),
        uvs=np.clip(uvs, 0.0, 1.0).astype(np.float32),
    )
    return {}

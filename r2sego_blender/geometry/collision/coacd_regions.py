"""Convex decomposition by CoACD (Wei et al. 2022), object by object and region by region.

CoACD closes a surface before it cuts it: it lays a thin shell around open ones, so its pieces
stand out by about a cell of that shell everywhere. It can end the process on damaged
input, so each region is cut in a child process, and within a time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import QhullError

from ...core.arrays import opened_arrays, save_arrays
from ...core.errors import GeometryError, NativeError
from ...core.progress import SILENT, Progress
from ...core.scratch import ScratchFolder
from ...workers.child import call_in_child
from ..mesh.meshes import compacted, connected
from .convex import Cutting, Limits, Piece, Soup, convex_hull, decompose
from .protrusion import FreeSide

# Measured on chairs: ten pieces in 12 s, as good as ten times slower settings.
_PARAMETERS = {
    "threshold": 0.05,
    "max_convex_hull": 16,
    "preprocess_mode": "on",
    "preprocess_resolution": 40,
    "mcts_iterations": 60,
    "seed": 0,
}
_SMALLEST_VOLUME_M3 = 1e-9


@dataclass(frozen=True)
class Region:
    """A connected part of a surface, named for people: ``vertices`` (V, 3), ``faces`` (F, 3)."""

    name: str
    vertices: np.ndarray
    faces: np.ndarray


def regions(vertices: np.ndarray, faces: np.ndarray, side_m: float) -> Iterator[Region]:
    """Connected components; one longer than ``side_m`` is cut into cells of that side."""
    component = connected(faces, len(vertices))[faces[:, 0]]
    for number, index in enumerate(np.unique(component)):
        members = faces[component == index]
        corners = vertices[members]
        if np.ptp(corners, axis=(0, 1)).max() <= side_m:
            yield Region(f"object {number}", *compacted(vertices, members))
            continue
        cells = np.floor(corners.mean(1) / side_m).astype(np.int64)
        places, cell = np.unique(cells, axis=0, return_inverse=True)
        for position, place in enumerate(places):
            centre = ", ".join(f"{value:.1f}" for value in (place + 0.5) * side_m)
            name = f"the region around ({centre})"
            yield Region(name, *compacted(vertices, members[cell.ravel() == position]))


def decompose_by_coacd(
    vertices: np.ndarray,
    faces: np.ndarray,
    side_m: float,
    limits: Limits,
    most: int,
    *,
    timeout_s: float = 120.0,
    floored: bool = False,
    progress: Progress = SILENT,
) -> list[Piece]:
    """Convex pieces of a surface: ``vertices`` (V, 3) world, metres, ``faces`` (F, 3).

    Regions are cells of ``side_m``. One that is convex within ``limits`` needs no cutting, as
    most of a wall. One that CoACD fails on, or takes longer than ``timeout_s``
    for, is decomposed by ``convex.decompose`` within ``limits`` into up to ``most`` pieces, and
    a warning names it. Raises GeometryError when vertices are not finite, or a face names
    a vertex that is not there.
    """
    _check(vertices, faces, "convex decomposition")
    soup = Soup.of(vertices, faces)
    if not len(soup.areas):
        return []
    free = FreeSide.of(soup.corners, soup.normals, floored)
    pieces: list[Piece] = []
    for region in progress.track(list(regions(vertices, faces, side_m)), "Convex decomposition"):
        soup = Soup.of(region.vertices, region.faces)
        cutting = Cutting(soup, free, limits)
        everything = np.arange(len(soup.areas))
        if not len(everything):
            continue
        if cutting.fits(everything):
            pieces.append(cutting.solid(everything))
            continue
        try:
            pieces += _in_child(region, timeout_s)
        except (NativeError, GeometryError) as error:
            progress.message(f"CoACD fails on {region.name}, which is cut into planes: {error}", level="warning")
            pieces += decompose(soup, limits, most, floored)[0]
    return pieces


def _check(vertices: np.ndarray, faces: np.ndarray, where: str) -> None:
    """CoACD reads outside its arrays for a face of a vertex that is not there, or ends the process."""
    if not np.isfinite(vertices).all() or (len(faces) and not 0 <= faces.min() <= faces.max() < len(vertices)):
        raise GeometryError(
            "the surface has vertices that are not finite, or faces of vertices that are not there",
            where=where,
            cure="Make the proxy again.",
        )


def _in_child(region: Region, timeout_s: float) -> list[Piece]:
    with ScratchFolder() as folder:
        request = {"region": str(Path(folder, "region.npz")), "pieces": str(Path(folder, "pieces.npz"))}
        save_arrays(Path(request["region"]), vertices=region.vertices, faces=region.faces)
        count = call_in_child(cut, request, timeout_s=timeout_s)["pieces"]
        with opened_arrays(Path(request["pieces"]), GeometryError, "these pieces cannot be read") as found:
            parts = [found[f"piece_{index}"] for index in range(count)]
    pieces = []
    for part in parts:
        try:
            vertices, faces = convex_hull(np.asarray(part, np.float64))
        except QhullError:  # flat: nothing to collide with
            continue
        a, b, c = np.moveaxis(vertices[faces], 1, 0)
        if np.einsum("fi,fi->", a, np.cross(b, c)) / 6 > _SMALLEST_VOLUME_M3:
            pieces.append((vertices, faces))
    if not pieces:
        raise GeometryError("it found no piece with a volume", where=region.name)
    return pieces


def cut(request: dict) -> dict:
    """Run CoACD on the file ``region``; writes the pieces' vertices to the file ``pieces``.

    For a child process. CoACD's own seed is fixed: the same region gives the same pieces.
    Raises GeometryError for a region without faces, or one damaged as ``decompose_by_coacd`` says.
    """
    import coacd

    coacd.set_log_level("error")
    with opened_arrays(Path(request["region"]), GeometryError, "this region cannot be read") as region:
        vertices, faces = np.asarray(region["vertices"], np.float64), np.asarray(region["faces"], np.int32)
    _check(vertices, faces, request["region"])
    if not len(faces):
        raise GeometryError("the region has no faces", where=request["region"])
    # CoACD is at its best near the origin.
    centre = vertices.mean(0)
    parts = coacd.run_coacd(coacd.Mesh(vertices - centre, faces), **_PARAMETERS)
    pieces = {f"piece_{index}": points + centre for index, (points, _) in enumerate(parts)}
    save_arrays(Path(request["pieces"]), **pieces)
    return {"pieces": len(parts)}

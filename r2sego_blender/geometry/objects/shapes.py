"""Shapes that can become priors: meshes in frames of their own, prepared for alignment.

A mesh of an artist, a library or a generator says nothing of where its object stands, how
large it is or which way is up. Here it gets a *canonical frame*: centred, of diagonal 1, its
axes along the directions most of its faces look. Furniture stands on one of those six.
"""

from __future__ import annotations

import contextlib
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...core.errors import GeometryError
from ..mesh.mesh_files import MESH_SUFFIXES, checked_mesh, read_mesh
from ..mesh.meshes import compacted, merged, normals_and_areas
from .surface_distance import SurfaceGrid

_MOST_LIBRARY_FILES, _MOST_LIBRARY_BYTES = 10_000, 20 << 30
_NO_LIBRARY = "Give the folder of the meshes, or withdraw it: with `objects --no-library`, or in Blender beside it."

_DETAILS = (1 / 20, 1 / 45, 1 / 400)  # of the diagonal: vertices nearer than this are drawn as one
_SAME_DIRECTION = np.cos(np.radians(12.0))
_LEAST_SHARE = 0.05  # of the area that has to look along an axis for it to be one
_TRIED = 256
_FACES_AT_ONCE = 1 << 16


@dataclass(frozen=True)
class Shape:
    """A mesh in its canonical frame.

    ``vertices`` (V, 3) float64 and ``faces`` (F, 3) int32 are the mesh as it was given, in
    its own frame; ``canonical_from_own`` (4, 4) is the similarity to the canonical frame.
    Canonical are ``drawn``, lighter meshes (vertices, faces) for silhouettes of growing
    size, and the ``surface``.
    """

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    canonical_from_own: np.ndarray
    drawn: tuple[tuple[np.ndarray, np.ndarray], ...]
    surface: SurfaceGrid

    @staticmethod
    def of(name: str, vertices: np.ndarray, faces: np.ndarray) -> Shape:
        """Prepare a mesh. Raises GeometryError when it has no surface or is damaged."""
        vertices, faces = _checked(name, vertices, faces)
        axes = _main_axes(vertices, faces)
        turned = vertices @ axes.T
        low, high = turned.min(0), turned.max(0)
        diagonal = float(np.linalg.norm(high - low))
        canonical = np.eye(4)
        canonical[:3, :3] = axes / diagonal
        canonical[:3, 3] = -(low + high) / (2 * diagonal)
        placed = vertices @ canonical[:3, :3].T + canonical[:3, 3]
        drawn = tuple(_lighter(placed, faces, detail) for detail in _DETAILS)
        return Shape(name, vertices, faces, canonical, drawn, SurfaceGrid.of(placed, faces))


def load_shape(path: Path) -> Shape:
    """The shape in a mesh file; all meshes of a scene are one. Its name is the file's.

    Raises GeometryError when the file holds no triangle mesh, see ``read_mesh``.
    """
    vertices, faces = read_mesh(path)
    try:
        return Shape.of(path.stem, vertices, faces)
    except GeometryError as error:
        raise GeometryError(error.what, where=path, cure=error.cure) from error


def require_library(folder: Path) -> None:
    """Raises GeometryError where ``folder`` holds more than a library of meshes: a refinement digests all of it."""
    files = (Path(where, name) for where, _, names in os.walk(folder) for name in names)
    count = size = 0
    for count, file in enumerate(files, 1):
        with contextlib.suppress(OSError):
            size += file.stat().st_size
        if count > _MOST_LIBRARY_FILES or size > _MOST_LIBRARY_BYTES:
            raise GeometryError(
                f"this is no library of meshes: it holds more than {_MOST_LIBRARY_FILES} files "
                f"or {_MOST_LIBRARY_BYTES >> 30} GiB",
                where=folder,
                cure="Put the meshes into a folder of their own, and name that with `r2sego objects`.",
            )


def mesh_files(folder: Path) -> list[Path]:
    """The mesh files of a library, in the order of their names. Raises GeometryError for none."""
    if not folder.is_dir():
        raise GeometryError("there is no such folder", where=folder, cure=_NO_LIBRARY)
    files = [path for path in folder.iterdir() if path.suffix.lower() in MESH_SUFFIXES]
    if not files:
        raise GeometryError(
            "the folder holds no mesh", where=folder, cure=f"Put {', '.join(MESH_SUFFIXES)} files there."
        )
    return sorted(files, key=lambda path: path.name)


def _checked(name: str, vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    try:
        vertices, faces = checked_mesh(np.asarray(vertices), np.asarray(faces))
    except GeometryError as error:
        raise GeometryError(error.what, where=name, cure=error.cure) from error
    vertices, faces = compacted(vertices, faces)
    if not len(faces) or normals_and_areas(vertices, faces)[1].sum() <= 0:
        raise GeometryError("the mesh has no surface", where=name, cure="Export the mesh again as triangles.")
    return vertices, faces


def _main_axes(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(3, 3) rotation whose rows are the directions most of the surface looks along.

    The own axes, where the surface looks along none.
    """
    normals, areas = normals_and_areas(vertices, faces)
    first = _most_common(normals, areas)
    if first is None:
        return np.eye(3)
    level = normals - (normals @ first)[:, None] * first
    length = np.linalg.norm(level, axis=1)
    upright = length > 0.5
    second = _most_common(level[upright] / length[upright, None], areas[upright])
    if second is None:
        second = np.eye(3)[int(np.argmin(np.abs(first)))]
    second = second - (second @ first) * first
    second /= np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)])


def _most_common(directions: np.ndarray, weights: np.ndarray) -> np.ndarray | None:
    """The direction, or its opposite, that the largest weight lies along; None for a small one."""
    if not len(directions):
        return None
    tried = directions[np.argsort(-weights, kind="stable")[:_TRIED]]
    votes = np.zeros(len(tried))
    for start in range(0, len(directions), _FACES_AT_ONCE):  # all at once would take gigabytes
        part = slice(start, start + _FACES_AT_ONCE)
        cosines = directions[part] @ tried.T
        np.abs(cosines, out=cosines)
        along = cosines > _SAME_DIRECTION
        del cosines
        votes += weights[part] @ along
    best = int(np.argmax(votes))
    near = np.abs(directions @ tried[best]) > _SAME_DIRECTION
    if weights @ near < _LEAST_SHARE * weights.sum():
        return None
    signed = directions[near] * np.sign(directions[near] @ tried[best])[:, None]
    mean = weights[near] @ signed
    return mean / np.linalg.norm(mean)


def _lighter(vertices: np.ndarray, faces: np.ndarray, detail: float) -> tuple[np.ndarray, np.ndarray]:
    """The mesh with the vertices of each cell of a grid made one."""
    means, cluster = merged(vertices, np.floor(vertices / detail).astype(np.int64))
    faces = np.sort(cluster[faces], axis=1)
    proper = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2])
    return means, np.unique(faces[proper], axis=0).astype(np.int32)

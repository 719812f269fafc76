"""Shapes that can become priors: meshes in frames of their own, prepared for alignment.

A mesh of an artist, a library or a generator says nothing of where its object stands, how
large it is or which way is up. Here it gets a *canonical frame*: centred, of diagonal 1, its
axes along the directions most of its faces look. Furniture stands on one of those six.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from ...core.errors import GeometryError
from ..mesh.meshes import compacted, merged, normals_and_areas
from .surface_distance import SurfaceGrid

MESH_SUFFIXES = (".glb", ".gltf", ".obj", ".off", ".ply", ".stl")

_DETAILS = (1 / 20, 1 / 45, 1 / 400)  # of the diagonal: vertices nearer than this are drawn as one
_SAME_DIRECTION = np.cos(np.radians(12.0))
_LEAST_SHARE = 0.05  # of the area that has to look along an axis for it to be one
_MOST_FACES = 2_000_000


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

    Raises GeometryError when the file holds no triangle mesh.
    """
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise GeometryError(f"'{path.suffix}' is no mesh format", where=path, cure=f"Use {', '.join(MESH_SUFFIXES)}.")
    try:
        mesh: Any = trimesh.load(path, force="mesh", process=False, skip_materials=True)
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    except Exception as error:  # trimesh's readers raise anything on damaged files
        raise GeometryError(
            f"the mesh cannot be read ({error})", where=path, cure="Export it again, as .glb or .obj."
        ) from error
    try:
        return Shape.of(path.stem, vertices, faces)
    except GeometryError as error:
        raise GeometryError(error.what, where=path, cure=error.cure) from error


def mesh_files(folder: Path) -> list[Path]:
    """The mesh files of a library, in the order of their names. Raises GeometryError for none."""
    if not folder.is_dir():
        raise GeometryError("there is no such folder", where=folder, cure="Give the folder of the meshes.")
    files = [path for path in folder.iterdir() if path.suffix.lower() in MESH_SUFFIXES]
    if not files:
        raise GeometryError(
            "the folder holds no mesh", where=folder, cure=f"Put {', '.join(MESH_SUFFIXES)} files there."
        )
    return sorted(files, key=lambda path: path.name)


def _checked(name: str, vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    vertices = np.ascontiguousarray(vertices, np.float64).reshape(-1, 3)
    faces = np.ascontiguousarray(faces, np.int32).reshape(-1, 3)
    cure = "Export the mesh again as triangles."
    if not np.isfinite(vertices).all():
        raise GeometryError("the mesh has vertices that are not finite", where=name, cure=cure)
    if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):
        raise GeometryError("the mesh has faces without vertices", where=name, cure=cure)
    if len(faces) > _MOST_FACES:
        raise GeometryError(f"the mesh has {len(faces)} faces", where=name, cure=f"Simplify it below {_MOST_FACES}.")
    vertices, faces = compacted(vertices, faces)
    if not len(faces) or normals_and_areas(vertices, faces)[1].sum() <= 0:
        raise GeometryError("the mesh has no surface", where=name, cure=cure)
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
    tried = directions[np.argsort(-weights, kind="stable")[:256]]
    along = np.abs(directions @ tried.T) > _SAME_DIRECTION
    best = int(np.argmax(weights @ along))
    if weights @ along[:, best] < _LEAST_SHARE * weights.sum():
        return None
    near = along[:, best]
    signed = directions[near] * np.sign(directions[near] @ tried[best])[:, None]
    mean = weights[near] @ signed
    return mean / np.linalg.norm(mean)


def _lighter(vertices: np.ndarray, faces: np.ndarray, detail: float) -> tuple[np.ndarray, np.ndarray]:
    """The mesh with the vertices of each cell of a grid made one."""
    means, cluster = merged(vertices, np.floor(vertices / detail).astype(np.int64))
    faces = np.sort(cluster[faces], axis=1)
    proper = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2])
    return means, np.unique(faces[proper], axis=0).astype(np.int32)

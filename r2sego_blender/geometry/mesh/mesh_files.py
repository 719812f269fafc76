"""Triangle meshes in files of others, which trimesh reads within bounds.

trimesh believes what a file says of itself: how many values an accessor has, how often a node shows a
mesh. What is counted here first is what takes memory or time out of proportion to the file.
"""

from __future__ import annotations

import io
import re
import urllib.parse
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from ...core.errors import GeometryError, may_not_be_read
from ...core.files_beside import file_beside
from ...core.gltf_files import gltf_document, gltf_tree
from ...core.text_files import read_bytes
from .meshes import require_sound

MESH_SUFFIXES = (".glb", ".gltf", ".obj", ".off", ".ply", ".stl")

LARGEST = 1e9
"""Of a coordinate, in the file's unit: beyond it the areas of faces have no digits left."""

_MOST_BYTES = 1 << 30
_MOST_FACES = 2_000_000
_FEWEST_FACES, _BYTES_A_FACE = 1 << 17, 10
"""So many faces may any file have, or one for so many bytes: all else shows a few of them many times."""

_MOST_PARTS = 4096
"""Materials, solids or primitives, each of which becomes a mesh of its own first."""
_ACCESSORS_A_PART = 8
_MOST_HEADER_LINES = 1024
_HEADER_BYTES = 1 << 20

_COMPONENT_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_MOST_TIMES, _LEAST_ROOM = 8, 16 << 20
"""So many times the file's bytes may the views and accessors of a glTF tell of, or so many bytes."""


def read_mesh(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) float64, finite, and triangles (F, 3) int32 of a mesh file; all meshes of a scene are one.

    Raises GeometryError where the file holds no triangle mesh, or more than it has bytes for.
    """
    suffix = path.suffix.lower()
    if suffix not in MESH_SUFFIXES:
        raise GeometryError(f"'{path.suffix}' is no mesh format", where=path, cure=f"Use {', '.join(MESH_SUFFIXES)}.")
    try:
        data = read_bytes(path, _MOST_BYTES)
        _require_bounded(data, suffix, path)
        mesh: Any = trimesh.load(
            io.BytesIO(data),
            file_type=suffix[1:],
            resolver=trimesh.resolvers.FilePathResolver(str(path)),
            force="mesh",
            process=False,
            skip_materials=True,
        )
        return _triangles(np.asarray(mesh.vertices), np.asarray(mesh.faces), len(data))
    except PermissionError as error:
        raise may_not_be_read(path, GeometryError) from error
    except GeometryError as error:
        raise GeometryError(error.what, where=path, cure=error.cure) from error
    except Exception as error:  # trimesh's readers raise anything on damaged files
        raise GeometryError(
            f"the mesh cannot be read ({error})", where=path, cure="Export it again, as .glb or .obj."
        ) from error


def checked_mesh(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A mesh of (V, 3) and (F, 3) numbers as float64 and int32.

    Raises GeometryError for other shapes, vertices that are not finite or too far, faces whose vertices
    are not there, and too many.
    """
    cure = "Export the mesh again as triangles."
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise GeometryError(f"the mesh has vertices {vertices.shape} and faces {faces.shape}", cure=cure)
    if len(faces) > _MOST_FACES:
        raise GeometryError(f"the mesh has {len(faces)} faces", cure=f"Simplify it below {_MOST_FACES}.")
    vertices = np.ascontiguousarray(vertices, np.float64)
    require_sound(vertices, faces, cure)
    if np.abs(vertices).max(initial=0.0) > LARGEST:
        raise GeometryError(f"the mesh has vertices beyond {LARGEST:g}", cure=cure)
    return vertices, np.ascontiguousarray(faces, np.int32)


def _triangles(vertices: np.ndarray, faces: np.ndarray, file_bytes: int) -> tuple[np.ndarray, np.ndarray]:
    if len(faces) > max(_FEWEST_FACES, file_bytes // _BYTES_A_FACE):
        raise GeometryError(
            f"the mesh has {len(faces)} faces in {file_bytes} bytes", cure="Export it again as triangles, each once."
        )
    return checked_mesh(vertices, faces)


def _require_bounded(data: bytes, suffix: str, path: Path) -> None:
    """Raises GeometryError for what would take more than its share, and whatever damage raises."""
    if suffix in (".glb", ".gltf"):
        _require_bounded_gltf(data, path)
    elif suffix == ".ply":
        header = data[: data.find(b"end_header", 0, _HEADER_BYTES)]
        if header.count(b"\n") > _MOST_HEADER_LINES:
            raise GeometryError("the header has no end", cure="Export the mesh again.")
    elif suffix == ".obj":
        _require_few(len(set(re.findall(rb"^usemtl[^\n]*", data, re.MULTILINE))))
    elif suffix == ".stl":
        _require_few(data.lower().count(b"endsolid") if data[:64].lstrip().lower().startswith(b"solid") else 0)


def _require_bounded_gltf(data: bytes, path: Path) -> None:
    document = gltf_document(data, path, GeometryError)[0]
    nodes, meshes, accessors = (document.get(name, []) for name in ("nodes", "meshes", "accessors"))
    children = [child for node in nodes for child in node.get("children", [])]
    uris = [entry["uri"] for entry in document.get("buffers", []) if not entry.get("uri", "data:").startswith("data:")]
    if len(set(children)) < len(children) or len(set(uris)) < len(uris):
        raise ValueError("a node has several parents, or a buffer several entries")
    size = len(data) + sum(file_beside(path, urllib.parse.unquote(uri)).stat().st_size for uri in uris)
    views = document.get("bufferViews", [])
    _require_few(max(len(views), len(accessors)) // _ACCESSORS_A_PART)
    told = [view["byteLength"] for view in views]
    told += [one["count"] * _COMPONENT_BYTES[one["componentType"]] * _WIDTHS[one["type"]] for one in accessors]
    if min(told, default=0) < 0 or size > _MOST_BYTES or sum(told) > max(_LEAST_ROOM, _MOST_TIMES * size):
        raise GeometryError(
            f"the glTF tells of {sum(told)} bytes and has {size}", cure="Export the mesh again, uncompressed."
        )
    faces = [
        sum(accessors[one.get("indices", one["attributes"]["POSITION"])]["count"] // 3 for one in mesh["primitives"])
        for mesh in meshes
    ]
    shown = [nodes[index]["mesh"] for index, _ in gltf_tree(document, path, GeometryError) if "mesh" in nodes[index]]
    _require_few(sum(len(meshes[mesh]["primitives"]) for mesh in (*range(len(meshes)), *shown)))
    if sum(faces[mesh] for mesh in shown) > max(_FEWEST_FACES, size // _BYTES_A_FACE):
        raise GeometryError("the scene shows its meshes too often", cure="Export one copy of the object.")


def _require_few(parts: int) -> None:
    if parts > _MOST_PARTS:
        raise GeometryError(f"the mesh has {parts} parts, of at most {_MOST_PARTS}", cure="Join them.")

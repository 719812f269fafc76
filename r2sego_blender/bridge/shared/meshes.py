"""Meshes from arrays and back, without a Python loop over vertices or faces."""

from __future__ import annotations

import bpy
import numpy as np

_ATTRIBUTE_TYPES = {"i": "INT", "u": "INT", "b": "BOOLEAN", "f": "FLOAT"}
_WIDE_ATTRIBUTE_TYPES = {3: "FLOAT_VECTOR", 4: "QUATERNION"}
_ATTRIBUTE_FIELDS = {
    "INT": ("value", np.int32, ()),
    "BOOLEAN": ("value", bool, ()),
    "FLOAT": ("value", np.float32, ()),
    "FLOAT_VECTOR": ("vector", np.float32, (3,)),
    "QUATERNION": ("value", np.float32, (4,)),
}


def mesh_from_arrays(name: str, vertices: np.ndarray, triangles: np.ndarray) -> bpy.types.Mesh:
    """A flat-shaded mesh of vertices (V, 3), metres, and triangles (F, 3), if any; nothing is selected."""
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", np.ascontiguousarray(vertices, np.float32).ravel())
    if len(triangles):
        mesh.loops.add(3 * len(triangles))
        mesh.loops.foreach_set("vertex_index", np.ascontiguousarray(triangles, np.int32).ravel())
        mesh.polygons.add(len(triangles))
        mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * len(triangles), 3, dtype=np.int32))
    mesh.update(calc_edges=True)
    mesh.shade_flat()
    for parts in (mesh.vertices, mesh.edges, mesh.polygons):  # new ones are selected
        parts.foreach_set("select", np.zeros(len(parts), bool))
    return mesh


def arrays_from_mesh(mesh: bpy.types.Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) float32 and triangles (F, 3) int32 of a mesh."""
    vertices = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", vertices)
    mesh.calc_loop_triangles()
    triangles = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    return vertices.reshape(-1, 3), triangles.reshape(-1, 3)


def add_attribute(mesh: bpy.types.Mesh, name: str, values: np.ndarray, domain: str = "FACE") -> None:
    """A named attribute with one number a face (or vertex, with ``domain`` POINT).

    Three columns are a vector, four a quaternion wxyz.
    """
    kind = _WIDE_ATTRIBUTE_TYPES[values.shape[1]] if values.ndim == 2 else _ATTRIBUTE_TYPES[values.dtype.kind]
    attribute = mesh.attributes.new(name, kind, domain)
    field, dtype, _ = _ATTRIBUTE_FIELDS[kind]
    attribute.data.foreach_set(field, np.ascontiguousarray(values, dtype).ravel())


def read_attribute(mesh: bpy.types.Mesh, name: str) -> np.ndarray:
    """The values (N,), (N, 3) or (N, 4) of an attribute made by ``add_attribute``."""
    attribute = mesh.attributes[name]
    field, dtype, width = _ATTRIBUTE_FIELDS[attribute.data_type]
    values = np.empty((len(attribute.data), *width), dtype)
    attribute.data.foreach_get(field, values.ravel())  # a view: it is contiguous
    return values


def add_colours(mesh: bpy.types.Mesh, name: str, srgb: np.ndarray) -> None:
    """A colour attribute with one sRGB uint8 colour (V, 3) a vertex."""
    attribute = mesh.color_attributes.new(name, "BYTE_COLOR", "POINT")
    colours = np.full((len(srgb), 4), 255, np.uint8)
    colours[:, :3] = srgb
    attribute.data.foreach_set("color_srgb", (colours / np.float32(255.0)).astype(np.float32).ravel())


def assign_materials(mesh: bpy.types.Mesh, materials: list, slot_of_face: np.ndarray) -> None:
    """Give the mesh these materials and each face the one at its slot (F,)."""
    for material in materials:
        mesh.materials.append(material)
    mesh.polygons.foreach_set("material_index", np.ascontiguousarray(slot_of_face, np.int32))
    mesh.update()

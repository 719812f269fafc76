"""The geometry proxy as a mesh coloured by provenance."""

from __future__ import annotations

import json

import bpy
import numpy as np

from ..geometry.proxy import PROVENANCE_COLOURS, GeometryProxy, Provenance
from .bundle import Bundle
from .materials import plain_material
from .meshes import add_attribute, arrays_from_mesh, assign_materials, mesh_from_arrays, read_attribute
from .outliner import fresh_collection

_PART = "Geometry proxy"


def show_proxy(scene: bpy.types.Scene, bundle: Bundle, round_index: int) -> bpy.types.Object:
    """The proxy of a round, in place of the one shown before.

    Faces carry the attributes ``provenance``, ``support``, ``confidence`` and ``instance``,
    and one of three materials by provenance. Raises SceneError when that round has none.
    """
    proxy = bundle.proxy(round_index)
    collection = fresh_collection(scene, bundle.name, _PART)
    mesh = proxy_mesh(proxy, f"Proxy, round {round_index}")
    created = bpy.data.objects.new(mesh.name, mesh)
    collection.objects.link(created)
    return created


def proxy_mesh(proxy: GeometryProxy, name: str) -> bpy.types.Mesh:
    """The proxy as a mesh with its face attributes and a material by provenance."""
    mesh = mesh_from_arrays(name, proxy.vertices, proxy.faces)
    add_attribute(mesh, "provenance", proxy.provenance)
    add_attribute(mesh, "support", proxy.support)
    add_attribute(mesh, "confidence", proxy.confidence)
    add_attribute(mesh, "instance", proxy.instance)
    mesh["instance_names"] = json.dumps(proxy.instance_names)
    materials = [provenance_material(kind) for kind in Provenance]
    assign_materials(mesh, materials, proxy.provenance)
    return mesh


def provenance_material(kind: Provenance) -> bpy.types.Material:
    """The material of faces with this provenance; its pass index is the provenance + 1."""
    material = plain_material(f"R2S-EGO {kind.name.lower()}", PROVENANCE_COLOURS[kind])
    material.pass_index = kind + 1
    return material


def proxy_of(mesh: bpy.types.Mesh) -> GeometryProxy:
    """The proxy back from a mesh that ``show_proxy`` made."""
    vertices, faces = arrays_from_mesh(mesh)
    return GeometryProxy(
        vertices, faces,
        read_attribute(mesh, "provenance").astype(np.uint8),
        read_attribute(mesh, "support").astype(np.uint16),
        read_attribute(mesh, "confidence"),
        read_attribute(mesh, "instance"),
        tuple(json.loads(mesh["instance_names"])),
    )  # fmt: skip

"""The geometry proxy as a mesh coloured by what is known of its faces."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import bpy
import numpy as np

from ...geometry.proxy.proxy import PROVENANCE_COLOURS, GeometryProxy, Provenance
from ...results.panels.bundle import Bundle
from ...results.panels.file_stamps import MADE, when_written
from ...results.panels.proxy_colours import ProxyFaces, coloured
from ...results.panels.proxy_coverage import read_coverage
from ..shared.materials import plain_material
from ..shared.meshes import add_attribute, assign_materials, mesh_from_arrays, read_attribute
from ..shared.outliner import find_collection, fresh_collection, link
from ..shared.simplified_viewport import draw_fewer_faces, drawn_faces

_PART = "Geometry proxy"
_ROUND, _VIEWS, _SEEN, _LEGEND = "r2sego_round", "r2sego_views", "seen", "r2sego_legend"


def show_proxy(scene: bpy.types.Scene, bundle: Bundle, round_index: int) -> bpy.types.Object:
    """The proxy of a round, in place of the one shown before.

    Faces carry the attributes ``provenance``, ``support``, ``confidence`` and ``instance``,
    where the coverage was measured also ``seen``, and one of three materials by provenance.
    Raises SceneError when that round has none.
    """
    proxy = bundle.proxy(round_index)
    coverage = read_coverage(bundle, round_index, len(proxy.faces))
    collection = fresh_collection(scene, bundle.path, _PART)
    mesh = proxy_mesh(proxy, f"Proxy, round {round_index}")
    mesh[_ROUND], mesh[MADE] = round_index, when_written(bundle.proxy_file(round_index))
    if coverage is not None:
        add_attribute(mesh, _SEEN, coverage.seen)
        mesh[_VIEWS] = coverage.views
    created = bpy.data.objects.new(mesh.name, mesh)
    draw_fewer_faces(created, drawn_faces())
    link(collection, created)
    return created


def shown_proxy(scene: bpy.types.Scene, bundle_path: str | Path) -> bpy.types.Object | None:
    """The object that ``show_proxy`` made, if it is still there."""
    collection = find_collection(scene, bundle_path, _PART)
    objects = collection.objects if collection is not None else ()
    return next((one for one in objects if one.type == "MESH" and _ROUND in one.data), None)


def shown_proxies() -> list[bpy.types.Object]:
    """All objects of this file that ``show_proxy`` made."""
    return [one for one in bpy.data.objects if one.type == "MESH" and _ROUND in one.data]


def draw_fewer_faces_of_proxies(most: int) -> None:
    """Have the views draw about ``most`` faces at most of every shown proxy, with 0 all of them."""
    for shown in shown_proxies():
        draw_fewer_faces(shown, most)


def shown_round(shown: bpy.types.Object) -> int:
    """The round whose proxy an object shows."""
    return int(shown.data[_ROUND])


def shows_older_proxy(shown: bpy.types.Object, written: Sequence[str]) -> bool:
    """Whether an object that ``show_proxy`` made shows another file than that of its round, of which
    ``written`` tells for each round when it was; earlier versions did not note it: no."""
    index = shown_round(shown)
    now = written[index] if index < len(written) else ""
    return shown.data.get(MADE, now) != now


@dataclass(frozen=True)
class LegendLine:
    """What a colour of a shown proxy means, sRGB in [0, 1], and how large its part is, square metres."""

    name: str
    colour: tuple[float, float, float]
    area: float


def legend_of(shown: bpy.types.Object) -> tuple[str, tuple[LegendLine, ...]]:
    """By what a shown proxy is coloured, and its colours' meaning; '' and none where it is not yet."""
    return _legend(str(shown.data.get(_LEGEND, "")))


@lru_cache(maxsize=64)  # panels ask at each redraw
def _legend(text: str) -> tuple[str, tuple[LegendLine, ...]]:
    if not text:
        return "", ()
    told = json.loads(text)
    return told["by"], tuple(LegendLine(name, tuple(colour), area) for name, colour, area in told["lines"])


def colour_proxy(shown: bpy.types.Object, by: str) -> bool:
    """Colour a shown proxy by one of ``COLOURINGS``; its mesh keeps the legend.

    Returns False, and nothing is changed, where it needs a coverage that was not measured.
    """
    mesh = shown.data
    names = ("provenance", "support", "confidence", *([_SEEN] if _SEEN in mesh.attributes else []))
    faces = ProxyFaces(*(read_attribute(mesh, name) for name in names), views=int(mesh.get(_VIEWS, 0)))
    colouring = coloured(by, faces)
    if colouring is None:
        return False
    if by == "PROVENANCE":
        materials = [provenance_material(kind) for kind in Provenance]
    else:
        title = by.lower().replace("_", " ")
        materials = [
            plain_material(f"R2S-EGO {title}: {label.lower()}", colour)
            for label, colour in zip(colouring.labels, colouring.colours, strict=True)
        ]
    mesh.materials.clear()
    assign_materials(mesh, materials, colouring.slot)
    area = np.empty(len(mesh.polygons), np.float32)
    mesh.polygons.foreach_get("area", area)
    areas_m2 = map(float, colouring.areas_m2(area))
    lines = list(zip(colouring.labels, map(list, colouring.colours), areas_m2, strict=True))
    mesh[_LEGEND] = json.dumps({"by": by, "lines": lines})
    return True


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

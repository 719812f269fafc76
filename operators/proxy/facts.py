"""What the room Geometry Proxy knows of the open bundle: objects, edits, coverage, the files' state."""

from collections.abc import Hashable
from dataclasses import dataclass

import bpy

from ...r2sego_blender.bridge.shared.panel_facts import Facts
from ...r2sego_blender.geometry.proxy.edits import PROXY_EDITS
from ...r2sego_blender.results.panels.bundle import Bundle
from ...r2sego_blender.results.panels.file_stamps import when_written
from ...r2sego_blender.results.panels.proxy_coverage import read_coverage
from ...r2sego_blender.results.panels.proxy_objects import read_objects

_KINDS = {"cut": "cut away", "draw": "drawn"}


@dataclass(frozen=True)
class ListedEdit:
    """An edit of the proxy that the bundle keeps; ``area`` in square metres."""

    name: str
    kind: str
    faces: int
    area: float


@dataclass(frozen=True)
class ProxyFacts:
    """``declared`` objects, ``edits``, when each round's proxy was ``written``, whether the coverage of the
    round that is shown was measured, the folder of the mesh ``library``, '' without one, and what Refine would
    redo, '' until it is asked."""

    declared: Facts = Facts()
    edits: Facts = Facts()
    written: tuple[str, ...] = ()
    has_coverage: bool = False
    library: str = ""
    plan: str = ""


def read(scene: bpy.types.Scene, bundle: Bundle) -> ProxyFacts:
    """What the bundle has. Raises R2SEgoError naming a damaged file."""
    edits = (
        ListedEdit(edit.name, _KINDS[edit.change.kind], edit.count, edit.change.area_m2)
        for edit in bundle.read(PROXY_EDITS)
    )
    return ProxyFacts(
        Facts(read_objects(bundle)),
        Facts(edits),
        tuple(when_written(bundle.proxy_file(index)) for index in range(bundle.rounds())),
        read_coverage(bundle, scene.r2sego.round_index) is not None,
        bundle.scene.declaration.mesh_library,
    )


def chosen_round(scene: bpy.types.Scene) -> Hashable:
    """The round that is shown."""
    return scene.r2sego.round_index

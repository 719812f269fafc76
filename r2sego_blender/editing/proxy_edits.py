"""Editing a scene's proxy by hand: faces cut away and surfaces drawn, kept in the bundle."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..bundle.scene import Scene
from ..bundle.stale import require_present_frame
from ..core import atomic_files
from ..core.arrays import opened_arrays, require_shapes
from ..core.errors import GeometryError
from ..geometry.objects.shapes import load_shape
from ..geometry.proxy.edited_proxy import cut_of, drawn_surface
from ..geometry.proxy.edits import PROXY_EDITS, Drawn, Edit, new_name
from ..geometry.proxy.proxy import PROXY, PROXY_FILE
from ..splats.formats.values import WORLD_FROM_Y_UP


def edit_proxy(
    scene: Scene, *, cut: Path | None = None, draw: Path | None = None, name: str = "", remove: Sequence[str] = ()
) -> tuple[Edit, ...]:
    """Change the edits of the scene's proxy; returns all there are then.

    ``cut`` is an ``.npz`` with ``round`` and ``corners`` (K, 3, 3) float32 of that round's proxy
    faces; ``draw`` one with ``vertices`` and ``faces`` in the world frame, or a mesh file, of which
    glTF is Y up; ``name`` is the new edit's, by default its file's; ``remove`` takes edits back. The next run
    redoes the proxy and what depends on it. Raises GeometryError, and SceneError for a cut of a proxy
    whose world frame was corrected since; changes nothing then.
    """
    with scene.locked():
        edits = list(scene.read(PROXY_EDITS))
        for gone in remove:
            if gone not in {edit.name for edit in edits}:
                known = ", ".join(edit.name for edit in edits) or "none"
                raise GeometryError(
                    f"there is no edit '{gone}'", where=scene.path / PROXY_EDITS.name, cure=f"There are: {known}."
                )
            edits = [edit for edit in edits if edit.name != gone]
        for file, change_of in ((cut, _cut), (draw, _drawn)):
            if file is not None:
                change = change_of(scene, file, edits)
                order = max((edit.order for edit in edits), default=0) + 1
                edits.append(Edit(new_name(name or file.stem, [e.name for e in edits]), order, change))
        _publish(scene, edits)
    return tuple(edits)


def move_proxy_edits(scene: Scene, similarity: np.ndarray) -> None:
    """Carry the edits into another world frame, (4, 4) similarity."""
    if edits := scene.read(PROXY_EDITS):
        _publish(scene, [edit.transformed(similarity) for edit in edits])


def describe_edits(scene: Scene) -> dict[str, Any]:
    """Every edit with its name, kind, faces and area, in their order."""
    return {
        "edits": [
            {"name": edit.name, "kind": edit.change.kind, "faces": edit.count, "area_m2": round(edit.change.area_m2, 4)}
            for edit in scene.read(PROXY_EDITS)
        ]
    }


def lines(described: dict[str, Any]) -> list[str]:
    """What ``describe_edits`` says, for a person."""
    told = {"cut": "cut away", "draw": "drawn"}
    return [
        f"{edit['name']:<20}{told[edit['kind']]:<10}{edit['faces']:>8} faces{edit['area_m2']:>10.3f} m2"
        for edit in described["edits"]
    ] or ["the proxy has no edits"]


def _cut(scene: Scene, file: Path, edits: Sequence[Edit]) -> Any:
    with opened_arrays(file, GeometryError, "this is no cut of the proxy", "Make it anew.") as data:
        require_shapes(data, corners="K 3 3")
        corners, round_index = data["corners"].astype(np.float32), int(data["round"])
    proxy = PROXY.of_round(round_index)
    if not (scene.path / proxy.name / PROXY_FILE).is_file():
        raise GeometryError(f"round {round_index} has no proxy", where=file, cure="Run `r2sego refine` first.")
    require_present_frame(scene, [proxy.name], "cut")
    return cut_of(scene.read(proxy), corners, edits)


def _drawn(scene: Scene, file: Path, edits: Sequence[Edit]) -> Drawn:
    if file.suffix.lower() != ".npz":
        shape = load_shape(file)
        vertices = shape.vertices
        if file.suffix.lower() in (".glb", ".gltf"):  # Y up, as that format demands
            vertices = vertices @ WORLD_FROM_Y_UP[:3, :3].T
        return drawn_surface(vertices, shape.faces)
    with opened_arrays(file, GeometryError, "this is no drawn surface", "Make it anew.") as data:
        return drawn_surface(data["vertices"], data["faces"])


def _publish(scene: Scene, edits: Sequence[Edit]) -> None:
    if not edits:
        atomic_files.remove(scene.path / PROXY_EDITS.name)
        return
    with scene.publishing(PROXY_EDITS.name) as folder:
        for edit in edits:
            edit.save(folder)

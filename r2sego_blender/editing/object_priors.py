"""Declaring a scene's objects, and what became of them: masks, meshes, poses held by hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..bundle import layout
from ..bundle.scene import Scene
from ..bundle.stale import require_present_frame
from ..captures.capture import Capture
from ..captures.store import CAPTURES
from ..core.atomic_files import remove as remove_files
from ..core.errors import GeometryError
from ..core.scratch import ScratchFolder
from ..geometry.objects.clusters import find_objects
from ..geometry.objects.objects import (
    ACCEPT,
    OBJECTS,
    REJECT,
    DeclaredObject,
    Placement,
    read_masks,
    read_placement,
    save_objects,
)
from ..geometry.objects.prior_files import PRIOR_RECORDS
from ..geometry.objects.priors import library_files
from ..geometry.objects.shapes import load_shape, mesh_files
from ..geometry.room.completed_depth import COMPLETED
from ..geometry.room.planes import PLANES
from ..geometry.stereo.observed_geometry import OBSERVED, ObservedGeometry
from .object_backends import cure_without_mesh, generated_meshes, segmented_objects


def declare_objects(
    scene: Scene,
    *,
    masks: Path | None = None,
    find: bool = False,
    vocabulary: Sequence[str] = (),
    library: Path | None = None,
    no_library: bool = False,
    meshes: Mapping[str, Path] | None = None,
    generate: Sequence[str] = (),
    place: Mapping[str, Path] | None = None,
    lock: Sequence[str] = (),
    unlock: Sequence[str] = (),
    accept: Sequence[str] = (),
    reject: Sequence[str] = (),
    reconsider: Sequence[str] = (),
    remove: Sequence[str] = (),
) -> Scene:
    """Write what a person says of the objects; returns the scene as declared then.

    ``masks`` replaces the objects by those of a folder (``read_masks``), ``find`` by what
    geometry alone takes for objects (``clusters``), words in ``vocabulary`` by what SAM 3 finds
    for them; masks of a name that is there already keep its mesh, pose and decision.
    ``library`` is the folder shapes are looked for in, ``no_library`` withdraws it; ``meshes`` gives single objects
    a mesh of their own, ``generate`` one that SAM 3D makes.
    ``place`` sets poses by hand, from files as ``placement.json``; without a mesh of its own an
    object takes the one of the last run. ``lock`` holds the last run's alignments as they are,
    with their meshes; ``unlock`` lets them go. ``accept`` and ``reject`` overrule what the
    figures say of a prior, ``reconsider`` lets them decide again. ``remove`` takes objects away,
    the last one too. The next run redoes only what depends on it. Raises GeometryError, and changes
    nothing then; SceneError where the world frame was corrected since what is needed was made;
    MachineError and NativeError where a learned backend is missing or fails.
    """
    words = [word.strip() for word in vocabulary if word.strip()]
    _require_one("the objects are given in two ways", [one for one in (masks, words, find) if one], 1)
    _require_one("a library is given and withdrawn", [one for one in (library, no_library) if one], 1)
    for said in ((*accept, *reject, *reconsider), (*lock, *unlock, *(place or {}))):
        _require_one("an object is decided on twice", said, len(set(said)))
    with scene.locked(), ScratchFolder() as temporary:
        captures = scene.read(CAPTURES)
        if masks is not None:
            declared = _with_what_is_known(read_masks(masks, captures), scene.read(OBJECTS).of(captures))
        elif words:
            declared = segmented_objects(words, captures, _observed(scene))
        else:
            declared = _found(scene, captures) if find else scene.read(OBJECTS).of(captures)
        objects = {one.name: one for one in declared}
        gone = {_known(objects, name, scene).name for name in remove}
        objects = {name: one for name, one in objects.items() if name not in gone}
        for name, mesh in (meshes or {}).items():
            load_shape(mesh)  # a mesh that cannot be read is refused now, not in the next run
            one = _known(objects, name, scene)
            objects[name] = replace(one, mesh=mesh, placement=None, backends=_but_mesh(one))
        asked = [_known(objects, name, scene) for name in generate]
        for one in generated_meshes(asked, captures, Path(temporary)):
            objects[one.name] = one
        found = _library(library, scene)
        for name, file in (place or {}).items():
            one = _known(objects, name, scene)
            mesh = one.mesh or _mesh_of_last_run(one, scene, found)
            objects[name] = replace(one, mesh=mesh, placement=read_placement(file))
        for name in lock:
            objects[name] = _locked(_known(objects, name, scene), scene, found)
        for name in unlock:
            objects[name] = replace(_known(objects, name, scene), placement=None)
        for names, decision in ((accept, ACCEPT), (reject, REJECT), (reconsider, "")):
            for name in names:
                objects[name] = replace(_known(objects, name, scene), decision=decision)
        if objects:
            with scene.publishing(layout.OBJECTS) as folder:
                save_objects(folder, list(objects.values()), [capture.name for capture in captures])
        else:  # as before the first: an empty folder would have all redone
            remove_files(scene.path / layout.OBJECTS)
        if no_library:
            return scene.declare(mesh_library="")
        return scene if library is None else scene.declare(mesh_library=str(found))


def move_objects(scene: Scene, similarity: np.ndarray) -> None:
    """Carry the poses held by hand into another world frame, (4, 4) similarity."""
    if not (scene.path / layout.OBJECTS).is_dir():
        return
    moved, captures = [], scene.read(CAPTURES)
    for one in scene.read(OBJECTS).of(captures):
        if (held := one.placement) is not None:
            one = replace(one, placement=replace(held, world_from_own=similarity @ held.world_from_own))
        moved.append(one)
    with scene.publishing(layout.OBJECTS) as place:
        save_objects(place, moved, [capture.name for capture in captures])


def describe_objects(scene: Scene) -> list[dict[str, Any]]:
    """Every declared object with the number of its masks and, after a run, its alignment."""
    records = _records(scene)
    return [
        {
            "name": one.name,
            "masks": sum(bool(mask.any()) for mask in one.masks.values()),
            "own_mesh": one.mesh is not None,
            "backends": dict(one.backends),
            "placed": one.placement is not None,
            "decision": one.decision,
            "locked": one.placement is not None and one.placement.locked,
        }
        | records.get(one.name, {})
        for one in scene.read(OBJECTS).of(scene.read(CAPTURES))
    ]


def lines(objects: Sequence[Mapping[str, Any]]) -> list[str]:
    """What ``describe_objects`` says, for a person."""
    if not objects:
        return ["no objects are declared; give masks with --masks FOLDER, or let --find look for some"]
    text = [f"{'object':<20}{'masks':>6}  {'shape':<24}{'energy':>7}{'overlap':>9}  result"]
    for one in objects:
        if one.get("backend") == "symmetry":
            figures = f"{'(symmetry)':<24}{one['energy']:>7.2f}{'-':>9}"
        elif "shape" in one:
            figures = f"{one['shape']:<24}{one['energy']:>7.2f}{one['silhouette_iou']:>9.2f}"
        else:
            figures = f"{'-':<24}{'-':>7}{'-':>9}"
        by_symmetry = "completed by symmetry, without a mesh" if one.get("backend") == "symmetry" else ""
        result = one.get("refusal") or by_symmetry or ("aligned" if "shape" in one else "not run yet")
        result += ", locked" if one["locked"] else ", placed by hand" if one.get("placed") else ""
        result += f", {one['decision']}ed by a person" if one.get("decision") else ""
        made = ", ".join(f"{part} by {name}" for part, name in one.get("backends", {}).items())
        result += f" ({made})" if made else ""
        text.append(f"{one['name']:<20}{one['masks']:>6}  {figures}  {result}")
    return text


def _require_one(what: str, given: Sequence[object], most: int) -> None:
    if len(given) > most:
        raise GeometryError(what, where="r2sego objects", cure="Give one of the options, and name each object once.")


def _but_mesh(one: DeclaredObject) -> dict[str, str]:
    """The backends of an object whose mesh a person gives."""
    return {part: name for part, name in one.backends.items() if part != "mesh"}


def _observed(scene: Scene) -> ObservedGeometry:
    if not (scene.path / layout.OBSERVED).is_file():
        raise GeometryError(
            "nothing is observed yet, by which the photographs' masks could be joined",
            where=scene.path,
            cure="Run `r2sego refine` first.",
        )
    require_present_frame(scene, [layout.OBSERVED], "used")
    return scene.read(OBSERVED)


def _found(scene: Scene, captures: Sequence[Capture]) -> tuple[DeclaredObject, ...]:
    if not (scene.path / layout.COMPLETED).is_dir():
        raise GeometryError("the captures have no depth yet", where=scene.path, cure="Run `r2sego refine` first.")
    require_present_frame(scene, [layout.COMPLETED, layout.PLANES], "searched")
    completed = scene.read(COMPLETED).of(captures)
    found = find_objects(captures, completed, scene.read(PLANES).envelope)
    if not found:
        raise GeometryError(
            "nothing stands free in what was observed", where=scene.path, cure="Draw masks and give them with --masks."
        )
    return found


def _records(scene: Scene) -> dict[str, dict[str, Any]]:
    """What the last run wrote of the objects, by name; empty before the first."""
    if not (scene.path / layout.PRIORS / "priors.json").is_file():
        return {}
    return {one["name"]: one for one in scene.read(PRIOR_RECORDS)}


def _known(objects: Mapping[str, DeclaredObject], name: str, scene: Scene) -> DeclaredObject:
    if name not in objects:
        raise GeometryError(
            f"there is no object '{name}'",
            where=scene.path,
            cure=f"Use one of {', '.join(sorted(objects))}." if objects else "Give its masks first.",
        )
    return objects[name]


def _library(library: Path | None, scene: Scene) -> Path | None:
    if library is not None:
        mesh_files(library)
        return library.resolve()
    return Path(scene.declaration.mesh_library) if scene.declaration.mesh_library else None


def _with_what_is_known(
    masked: Sequence[DeclaredObject], before: Sequence[DeclaredObject]
) -> tuple[DeclaredObject, ...]:
    """The objects with new masks, with the meshes, poses and decisions those of their names had."""
    known = {one.name: one for one in before}
    return tuple(
        replace(
            one,
            mesh=old.mesh,
            placement=old.placement,
            decision=old.decision,
            backends={part: name for part, name in old.backends.items() if part == "mesh"},
        )
        if (old := known.get(one.name)) is not None
        else one
        for one in masked
    )


def _mesh_of_last_run(one: DeclaredObject, scene: Scene, library: Path | None) -> Path:
    """The mesh of the library that the last run took for an object. Raises GeometryError: none."""
    shape = _records(scene).get(one.name, {}).get("shape", "")
    mesh = library_files(library).get(shape) if library is not None else None
    if mesh is None:
        raise GeometryError(f"'{one.name}' has no mesh to place", where=scene.path, cure=cure_without_mesh(one.name))
    return mesh


def _locked(one: DeclaredObject, scene: Scene, library: Path | None) -> DeclaredObject:
    record = _records(scene).get(one.name, {})
    if record.get("backend") == "symmetry":
        raise GeometryError(
            f"'{one.name}' was completed by its symmetry and has no mesh to hold",
            where=scene.path,
            cure=cure_without_mesh(one.name),
        )
    if "world_from_own" not in record:
        raise GeometryError(f"'{one.name}' has no alignment yet", where=scene.path, cure="Run `r2sego refine` first.")
    require_present_frame(scene, [layout.PRIORS], "held")
    mesh = one.mesh or _mesh_of_last_run(one, scene, library)
    return replace(one, mesh=mesh, placement=Placement(np.array(record["world_from_own"]), locked=True))

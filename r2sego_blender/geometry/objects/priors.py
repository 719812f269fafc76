"""Aligned shape priors P_m after T_m*, solved once from the real captures and then fixed.

For each declared object: the evidence is gathered, its own mesh or the library's candidates
are aligned, and the best is kept if it explains the object. If asked for, an object without
such a mesh gets what its own mirror symmetry adds. Every decision is written down with its
figures, the refused ones too.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...captures.capture import Capture
from ...config.settings import PriorSettings
from ...core.cameras import Camera
from ...core.errors import GeometryError
from ...core.json_files import rounded
from ...core.progress import SILENT, Progress
from ...core.threads import in_threads
from ..room.planes import RoomPlanes
from ..stereo.observed_geometry import ObservedGeometry
from .alignment import Alignment, ObjectEvidence, rated, realigned
from .masked_points import points_on_object
from .mirrored_surface import mirrored_surface
from .objects import ACCEPT, REJECT, DeclaredObject
from .prior_files import AlignedPrior, ObjectPrior
from .retrieval import Retrieval, refusal, retrieve, too_few_points
from .shapes import Shape, load_shape, mesh_files
from .symmetry import ObjectSight, find_mirror_planes

NEARER_THAN_ANYTHING_M = 0.01
"""The depth given to pixels where another object may stand before this one."""

"""The folder of shapes that were not good enough, beside the accepted priors."""

_BY_HAND = "a person rejected it"


def align_objects(
    objects: Sequence[DeclaredObject],
    library: Sequence[Shape],
    captures: Sequence[Capture],
    observed: ObservedGeometry,
    reliable: Sequence[np.ndarray],
    completed: Sequence[np.ndarray],
    bounds: RoomPlanes,
    settings: PriorSettings,
    progress: Progress = SILENT,
) -> tuple[ObjectPrior, ...]:
    """Retrieve and align a shape for every object, as many at a time as there are threads.

    ``reliable`` and ``completed`` are each capture's depth (H, W), at its own size; ``library``
    serves the objects that have no mesh of their own.
    """
    anything = [np.zeros(capture.camera.shape, bool) for capture in captures]
    for pixels, capture in zip(anything, captures, strict=True):
        for one in objects:
            pixels |= one.masks.get(capture.name, False)

    def work(one: DeclaredObject) -> ObjectPrior:
        try:
            evidence = gather_evidence(one, captures, observed, reliable, completed, anything, bounds)
            return _decided(one, evidence, library, settings)
        except GeometryError as error:
            return ObjectPrior(one.name, None, error.what, {"name": one.name, "refusal": error.what})

    found = list(in_threads(work, objects, progress, "Aligning shape priors"))
    if settings.symmetry == "unmatched":
        # One after the other: the kernels of fusion share threads of their own.
        for k, one in enumerate(objects):
            if found[k].prior is None and one.decision != REJECT:
                known = _gathered(one, captures, observed, reliable, completed, anything)
                found[k] = _completed_by_symmetry(found[k], known, settings)
    return tuple(found)


@dataclass(frozen=True)
class _Gathered:
    """Of the captures that have a mask of an object: ``cameras``, ``masks`` (H, W) bool, ``depths``
    and ``reliable`` (H, W) metres, 0 = unknown; ``points`` (P, 3) were observed on it."""

    cameras: list[Camera]
    masks: list[np.ndarray]
    depths: list[np.ndarray]
    reliable: list[np.ndarray]
    points: np.ndarray


def gather_evidence(
    one: DeclaredObject,
    captures: Sequence[Capture],
    observed: ObservedGeometry,
    reliable: Sequence[np.ndarray],
    completed: Sequence[np.ndarray],
    anything: Sequence[np.ndarray],
    bounds: RoomPlanes,
) -> ObjectEvidence:
    """The masks, the observed points they share, and what the captures know around them.

    ``anything`` (H, W) bool: the pixels of any object. Where another one may be in front its
    depth is not trusted unless stereo vouches for it.
    """
    known = _gathered(one, captures, observed, reliable, completed, anything)
    return ObjectEvidence.of(one.name, known.cameras, known.masks, known.depths, known.points, bounds)


def _gathered(
    one: DeclaredObject,
    captures: Sequence[Capture],
    observed: ObservedGeometry,
    reliable: Sequence[np.ndarray],
    completed: Sequence[np.ndarray],
    anything: Sequence[np.ndarray],
) -> _Gathered:
    shown = [k for k, capture in enumerate(captures) if capture.name in one.masks]
    masks = [one.masks[captures[k].name] for k in shown]
    depths = []
    for k, mask in zip(shown, masks, strict=True):
        other = anything[k] & ~mask & (reliable[k] == 0)
        known = np.where(reliable[k] > 0, reliable[k], completed[k])
        depths.append(np.where(other, np.float32(NEARER_THAN_ANYTHING_M), known))
    cameras = [captures[k].camera for k in shown]
    on_object = points_on_object(observed.points, observed.visibility, cameras, masks, shown)
    points = observed.points[on_object].astype(np.float64)
    return _Gathered(cameras, masks, depths, [reliable[k] for k in shown], points)


def library_files(folder: Path) -> dict[str, Path]:
    """The meshes of a library by the names of their shapes, in order: ``chair``, or ``chair.glb``
    where another format has that name too. Raises GeometryError for none."""
    files = mesh_files(folder)
    stems, whole = Counter(path.stem for path in files), {path.name for path in files}
    alone = [stems[path.stem] == 1 and path.stem not in whole for path in files]
    return {path.stem if own else path.name: path for path, own in zip(files, alone, strict=True)}


def load_library(folder: Path, progress: Progress = SILENT) -> tuple[Shape, ...]:
    """The shapes in a folder of meshes, named as by ``library_files``; those that cannot be read
    are left out with a warning."""
    files = library_files(folder)
    shapes = []
    with progress.task("Reading the mesh library", len(files)) as task:
        for name, path in files.items():
            try:
                shapes.append(replace(load_shape(path), name=name))
            except GeometryError as error:
                progress.message(f"left out: {error}", "warning")
            task.advance()
    return tuple(shapes)


def _decided(
    one: DeclaredObject, evidence: ObjectEvidence, library: Sequence[Shape], settings: PriorSettings
) -> ObjectPrior:
    candidates = library if one.mesh is None else (load_shape(one.mesh),)
    if not candidates:
        what = "there is no mesh for it and no library"
        return ObjectPrior(one.name, None, what, {"name": one.name, "refusal": what})
    by_hand = None if one.mesh is None else one.placement
    if by_hand is None and (few := too_few_points(evidence, settings)):
        record = {"name": one.name, "refusal": few, "observed_points": len(evidence.points)}
        return ObjectPrior(one.name, None, few, record)
    if by_hand is not None:
        place = rated if by_hand.locked else realigned
        placed = place(candidates[0], evidence, by_hand.world_from_own)
        # What a person holds is not judged.
        reason = "" if by_hand.locked else refusal(placed, evidence, settings)
        retrieval = Retrieval(placed, {}, {}, reason)
    else:
        retrieval = retrieve(evidence, candidates, settings)
    best, verdict = retrieval.best, retrieval.refusal
    if one.decision:
        verdict = _BY_HAND if one.decision == REJECT else ""
    record = {"name": one.name, "refusal": verdict, "observed_points": len(evidence.points)}
    if one.decision == ACCEPT and retrieval.refusal:
        record["accepted_despite"] = retrieval.refusal
    if one.mesh is not None and "mesh" in one.backends:
        record["mesh_by"] = one.backends["mesh"]
    record |= _figures(best) | {
        "rough": {name: round(energy, 4) for name, energy in retrieval.rough.items()},
        "screening": {name: round(energy, 4) for name, energy in retrieval.screening.items()},
    }
    shape = next(shape for shape in candidates if shape.name == best.shape)
    world = shape.vertices @ best.world_from_own[:3, :3].T + best.world_from_own[:3, 3]
    prior = AlignedPrior(one.name, world, shape.faces)
    return ObjectPrior(one.name, None if verdict else prior, verdict, record, prior if verdict else None)


def _completed_by_symmetry(refused: ObjectPrior, known: _Gathered, settings: PriorSettings) -> ObjectPrior:
    """The object with what its mirror image adds; as it was, where that is nothing."""
    if len(known.points) < settings.min_points:
        return refused
    sight = ObjectSight.of(known.cameras, known.masks, known.depths, known.reliable)
    planes = find_mirror_planes(known.points, sight, settings.max_mirror_energy)
    if not planes:
        return refused
    vertices, faces = mirrored_surface(planes, known.points, known.masks, known.reliable, sight)
    if not len(faces):
        return refused
    record = {
        "name": refused.name,
        "refusal": "",
        "backend": "symmetry",
        "no_mesh": refused.refusal,
        "energy": round(planes[0].energy, 4),
        "observed_points": len(known.points),
        "mirror_planes": [
            {
                "normal": plane.normal.tolist(),
                "offset_m": plane.offset,
                "energy": round(plane.energy, 4),
                "confirmed": round(plane.confirmed, 4),
            }
            for plane in planes
        ],
    }
    return ObjectPrior(refused.name, AlignedPrior(refused.name, vertices, faces), "", record)


def _figures(alignment: Alignment) -> dict[str, Any]:
    return {
        "backend": "mesh",
        "shape": alignment.shape,
        "world_from_own": alignment.world_from_own.tolist(),
        "energy": round(alignment.energy, 4),
        "silhouette_iou": round(alignment.silhouette_iou, 4),
        "ious": [rounded(iou) for iou in alignment.ious],
        "point_residual": round(alignment.point_residual, 4),
        "point_distance_m": rounded(alignment.point_distance_m),
        "free_space": round(alignment.free_space, 4),
        "outside": round(alignment.outside, 4),
    }

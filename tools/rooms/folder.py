"""A made room as files: photographs with poses as the product reads them, and the truth beside them."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import EvaluationError
from r2sego_blender.core.json_files import read_json, write_json
from r2sego_blender.evaluation.ground_truth import GroundTruth, TrueView, save_ground_truth
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer

from .seen import overlap_share, support_gap


@dataclass(frozen=True)
class View:
    """A rendered picture and its truth: ``depth`` (H, W) float32 planar metres, ``ids`` (H, W) instances, -1 none."""

    name: str
    camera: Camera
    depth: np.ndarray
    ids: np.ndarray


@dataclass(frozen=True)
class TrueRoom:
    """The true surface: ``vertices`` (V, 3) metres, ``faces`` (F, 3), ``instances`` (F,) indices of ``names``."""

    vertices: np.ndarray
    faces: np.ndarray
    instances: np.ndarray
    names: tuple[str, ...]


def seen_view(name: str, camera: Camera, surface: MeshRasterizer, room: TrueRoom) -> View:
    """What a camera truly sees; ``surface`` draws the room's mesh."""
    seen = surface.render(camera)
    return View(name, camera, seen.depth, seen.of_face(room.instances, missing=-1))


def write_room(
    folder: Path,
    room: TrueRoom,
    sets: Mapping[str, Sequence[View]],
    frozen: Sequence[View],
    told: Mapping[str, Any],
    only_measured: Mapping[str, Sequence[View]] | None = None,
) -> dict[str, Any]:
    """Write all but the pictures, which lie there as ``photographs/NAME.png`` and ``frozen/NAME.png``.

    ``sets`` of captures by name; views may be in several. ``cameras.json`` has all their views; where there are
    more sets than one, each has its ``cameras_SET.json`` too. Sets that are ``only_measured`` have no pictures.
    What ``info.json`` says is returned: ``told``, and what is measured of every set.
    """
    captures = list({view.name: view for views in sets.values() for view in views}.values())
    _write_cameras(folder / "cameras.json", captures, frozen)
    for name, views in sets.items() if len(sets) > 1 else ():
        _write_cameras(folder / f"cameras_{name}.json", views, frozen)
    truth = tuple(TrueView(view.name, view.camera, view.depth, view.ids.astype(np.int16)) for view in captures)
    save_ground_truth(GroundTruth(truth, room.vertices, room.faces, room.instances, room.names), folder)
    for place, kept in ((folder / "depth", captures), (folder / "frozen" / "depth", frozen)):
        place.mkdir(parents=True, exist_ok=True)
        for view in kept:
            np.save(place / f"{view.name}.npy", view.depth)
    trimesh.Trimesh(room.vertices, room.faces, process=False).export(folder / "mesh.ply")
    lens = captures[0].camera.to_json()
    del lens["world_from_camera"]
    measured = {name: measured_set(views, frozen) for name, views in {**sets, **(only_measured or {})}.items()}
    info = {
        **told,
        "lens": lens,
        **(measured if len(measured) > 1 else next(iter(measured.values()))),
        "frozen": len(frozen),
        "frozen_sha256": views_digest(frozen),
    }
    write_json(folder / "info.json", info)
    return info


def require_same(folder: Path, fixed: Mapping[str, Any]) -> None:
    """Write what is fixed before any picture is made into ``fixed.json``, or compare it with what is there.

    Raises EvaluationError where a folder's pictures are of something else: they would be kept for this.
    """
    file = folder / "fixed.json"
    if not file.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        write_json(file, dict(fixed))
    elif read_json(file) != dict(fixed):
        raise EvaluationError("the folder has pictures of another room", where=file, cure="Give another folder.")


def measured_set(captures: Sequence[View], frozen: Sequence[View]) -> dict[str, float]:
    """Of a set of captures: how many, their overlap, the support gap of the frozen views, and what sees no surface."""
    seen = [view.camera for view in captures], [view.depth for view in captures]
    return {
        "captures": len(captures),
        "overlap": overlap_share(*seen),
        "support_gap": support_gap([view.camera for view in frozen], [view.depth for view in frozen], *seen),
        "pixels_without_surface": float(np.mean([(depth <= 0.0).mean() for depth in seen[1]])),
    }


def _write_cameras(file: Path, captures: Sequence[View], frozen: Sequence[View]) -> None:
    lens = captures[0].camera.to_json()
    del lens["world_from_camera"]
    poses = {
        key: [
            {"file": f"{kind}/{view.name}.png", "world_from_camera": view.camera.world_from_camera.tolist()}
            for view in views
        ]
        for key, kind, views in (("captures", "photographs", captures), ("frozen", "frozen", frozen))
    }
    write_json(file, {**lens, **poses})


def views_digest(views: Sequence[View]) -> str:
    """The SHA-256 of views' names, lenses and poses, in their order: of what is fixed before anything runs."""
    digest = hashlib.sha256()
    for view in views:
        camera = view.camera
        lens = [camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy]
        digest.update(view.name.encode() + b"\0")
        digest.update(np.array([*lens, *camera.world_from_camera.ravel()], "<f8").tobytes())
    return digest.hexdigest()

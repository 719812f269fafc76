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
from r2sego_blender.core.json_files import write_json
from r2sego_blender.evaluation.ground_truth import GroundTruth, TrueView, save_ground_truth

from .seen import overlap_share, support_gap


@dataclass(frozen=True)
class View:
    """A rendered picture and its truth: ``depth`` (H, W) float32 planar metres, ``ids`` (H, W) instances, -1 none."""

    name: str
    camera: Camera
    depth: np.ndarray
    ids: np.ndarray


def write_room(
    folder: Path,
    vertices: np.ndarray,
    faces: np.ndarray,
    instances: np.ndarray,
    names: Sequence[str],
    views: Mapping[str, Sequence[View]],
    told: Mapping[str, Any],
) -> dict[str, Any]:
    """Write all but the pictures, which lie there as ``photographs/NAME.png`` and ``frozen/NAME.png``.

    ``views`` by these folders. What ``info.json`` says is returned: ``told``, and what is measured of the views.
    """
    captures, frozen = views["photographs"], views["frozen"]
    lens = captures[0].camera.to_json()
    del lens["world_from_camera"]
    poses = {
        key: [
            {"file": f"{kind}/{view.name}.png", "world_from_camera": view.camera.world_from_camera.tolist()}
            for view in views[kind]
        ]
        for key, kind in (("captures", "photographs"), ("frozen", "frozen"))
    }
    write_json(folder / "cameras.json", {**lens, **poses})
    truth = tuple(TrueView(view.name, view.camera, view.depth, view.ids.astype(np.int16)) for view in captures)
    save_ground_truth(GroundTruth(truth, vertices, faces, instances, tuple(names)), folder)
    for place, kept in ((folder / "depth", captures), (folder / "frozen" / "depth", frozen)):
        place.mkdir(exist_ok=True)
        for view in kept:
            np.save(place / f"{view.name}.npy", view.depth)
    trimesh.Trimesh(vertices, faces, process=False).export(folder / "mesh.ply")
    seen = [view.camera for view in captures], [view.depth for view in captures]
    info = {
        **told,
        "lens": lens,
        "captures": len(captures),
        "overlap": overlap_share(*seen),
        "support_gap": support_gap([view.camera for view in frozen], [view.depth for view in frozen], *seen),
        "pixels_without_surface": float(np.mean([(depth <= 0.0).mean() for depth in seen[1]])),
        "frozen": len(frozen),
        "frozen_sha256": frozen_digest(folder, frozen),
    }
    write_json(folder / "info.json", info)
    return info


def frozen_digest(folder: Path, frozen: Sequence[View]) -> str:
    """The SHA-256 of the frozen views' names, lenses, poses and pictures, in their order."""
    digest = hashlib.sha256()
    for view in frozen:
        camera = view.camera
        lens = [camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy]
        digest.update(view.name.encode() + b"\0")
        digest.update(np.array([*lens, *camera.world_from_camera.ravel()], "<f8").tobytes())
        digest.update((folder / "frozen" / f"{view.name}.png").read_bytes())
    return digest.hexdigest()

"""Structural conditions on disk."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from ..arrays import opened_arrays
from ..cameras import Camera
from ..errors import GenerationError
from .conditions import Condition

_MILLIMETRES = 1000.0
_NORMAL_STEPS = 127.0  # unit normals are stored as int8


def save_conditions(folder: Path, conditions: Sequence[Condition]) -> None:
    """Write each condition as two files that together are small.

    ``000_depth.png``: 16-bit depth in millimetres, 0 = unknown (also beyond 65 m);
    ``000.npz``: the camera, validity (uint8 of 255), provenance, instance and normal (int8 of 127).
    """
    folder.mkdir(parents=True, exist_ok=True)
    for index, condition in enumerate(conditions):
        millimetres = np.rint(condition.depth * _MILLIMETRES)
        millimetres[millimetres > np.iinfo(np.uint16).max] = 0
        _, png = cv2.imencode(".png", millimetres.astype(np.uint16), [cv2.IMWRITE_PNG_COMPRESSION, 2])
        (folder / f"{index:03d}_depth.png").write_bytes(png.tobytes())
        np.savez_compressed(
            folder / f"{index:03d}.npz",
            camera=json.dumps(condition.camera.to_json()),
            validity=np.rint(condition.validity * 255.0).astype(np.uint8),
            provenance=condition.provenance,
            instance=condition.instance,
            normal=np.rint(condition.normal * _NORMAL_STEPS).astype(np.int8),
        )


def load_conditions(folder: Path) -> tuple[Condition, ...]:
    """Read what ``save_conditions`` wrote: depths to half a millimetre, normals to half a degree.

    Raises GenerationError when a file is missing or damaged.
    """
    conditions = []
    for path in sorted(folder.glob("[0-9][0-9][0-9].npz")):
        with opened_arrays(path, GenerationError, "this structural condition is damaged") as data:
            camera = Camera.from_json(json.loads(str(data["camera"])))
            validity = data["validity"].astype(np.float32) / 255.0
            provenance, instance = data["provenance"], data["instance"]
            normal = data["normal"].astype(np.float32)
            png = np.frombuffer(path.with_name(f"{path.stem}_depth.png").read_bytes(), np.uint8)
            depth = cv2.imdecode(png, cv2.IMREAD_UNCHANGED) if len(png) else None
            if depth is None or depth.shape != camera.shape or depth.dtype != np.uint16:
                raise ValueError("the depth is not a 16-bit PNG of the camera's size")
        normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), np.float32(1.0))
        depth = depth.astype(np.float32) / _MILLIMETRES
        conditions.append(Condition(camera, depth, normal, provenance, validity, instance))
    if not conditions:
        raise GenerationError("there are no conditions here", where=folder, cure="Run the round again.")
    return tuple(conditions)

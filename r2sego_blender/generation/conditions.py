"""Structural conditions z_v: the geometry proxy rendered along a camera path."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from ..arrays import opened_arrays
from ..cameras import Camera
from ..errors import GenerationError
from ..geometry.proxy import GeometryProxy
from ..geometry.rasterizer import MeshRasterizer

NO_PROVENANCE = 255
"""The provenance of a pixel that shows no proxy surface."""

_MILLIMETRES = 1000.0
_NORMAL_STEPS = 127.0  # unit normals are stored as int8


@dataclass(frozen=True)
class Condition:
    """What the proxy looks like from one camera of a path.

    ``depth`` (H, W) float32 planar metres, 0 where there is no surface; ``validity``
    (H, W) float32 in [0, 1], 1 where the free side of a surface that some capture saw is
    shown (a surface none saw anchors nothing); ``provenance``
    (H, W) uint8 of ``Provenance`` or ``NO_PROVENANCE``; ``normal`` (H, W, 3) float32, the
    unit face normal in the world, zero where there is no surface.
    """

    camera: Camera
    depth: np.ndarray
    validity: np.ndarray
    provenance: np.ndarray
    normal: np.ndarray


class ConditionRenderer:
    """Renders structural conditions of one geometry proxy."""

    def __init__(self, proxy: GeometryProxy, rasterizer: MeshRasterizer | None = None) -> None:
        """``rasterizer``, when given, is one made of the proxy's own vertices and faces."""
        self._rasterizer = rasterizer or MeshRasterizer(proxy.vertices, proxy.faces)
        self._provenance = proxy.provenance
        self._supported = proxy.support > 0
        corners = proxy.vertices[proxy.faces].astype(np.float64)
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        self._normal = (normal / np.maximum(length, np.finfo(np.float64).tiny)).astype(np.float32)

    def depth(self, camera: Camera) -> np.ndarray:
        """The proxy's planar depth (H, W) float32, metres, 0 where there is no surface."""
        return self._rasterizer.render(camera).depth

    def condition(self, camera: Camera) -> Condition:
        """The structural condition at one camera."""
        buffers = self._rasterizer.render(camera)
        normal = buffers.of_face(self._normal)
        ray = camera.rays().astype(np.float32) @ camera.world_from_camera[:3, :3].T.astype(np.float32)
        facing = np.einsum("hwc,hwc->hw", normal, ray) < 0.0
        return Condition(
            camera=camera,
            depth=buffers.depth,
            validity=(facing & buffers.of_face(self._supported, False)).astype(np.float32),
            provenance=buffers.of_face(self._provenance.astype(np.uint8), NO_PROVENANCE),
            normal=normal,
        )


def render_conditions(renderer: ConditionRenderer, path: Sequence[Camera]) -> tuple[Condition, ...]:
    """The proxy rendered along a path, one condition a camera."""
    return tuple(renderer.condition(camera) for camera in path)


def save_conditions(folder: Path, conditions: Sequence[Condition]) -> None:
    """Write each condition as two files that together are small.

    ``000_depth.png``: 16-bit depth in millimetres, 0 = unknown (also beyond 65 m);
    ``000.npz``: the camera, validity (uint8 of 255), provenance and normal (int8 of 127).
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
            provenance, normal = data["provenance"], data["normal"].astype(np.float32)
            png = np.frombuffer(path.with_name(f"{path.stem}_depth.png").read_bytes(), np.uint8)
            depth = cv2.imdecode(png, cv2.IMREAD_UNCHANGED) if len(png) else None
            if depth is None or depth.shape != camera.shape or depth.dtype != np.uint16:
                raise ValueError("the depth is not a 16-bit PNG of the camera's size")
        length = np.linalg.norm(normal, axis=-1, keepdims=True)
        normal = normal / np.maximum(length, np.float32(1.0))
        conditions.append(
            Condition(camera, depth.astype(np.float32) / _MILLIMETRES, validity, provenance, normal)
        )
    if not conditions:
        raise GenerationError("there are no conditions here", where=folder, cure="Run the round again.")
    return tuple(conditions)

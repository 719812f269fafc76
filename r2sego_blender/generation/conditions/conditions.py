"""Structural conditions z_v: the geometry proxy rendered along a camera path.

Renderers differ in where they run (a z-buffer here, Cycles and EEVEE in a Blender), not in
what they return.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ...core.cameras import Camera
from ...core.compiled import parallel_kernel, prange
from ...geometry.mesh.meshes import normals_and_areas
from ...geometry.proxy.proxy import GeometryProxy
from ...geometry.visibility.rasterizer import MeshRasterizer

BACKENDS = {"z-buffer": "embedded: numba z-buffer"}
ORDER = 0

NOTHING = 0
"""The provenance of a pixel that shows no proxy surface; elsewhere it is ``Provenance`` + 1."""


@dataclass(frozen=True)
class Condition:
    """What the proxy looks like from one camera of a path, z_v,t.

    ``depth`` (H, W) float32 planar z in metres, 0 where nothing is seen; ``normal``
    (H, W, 3) float32, unit, in the world frame and towards the camera, 0 where nothing is
    seen; ``provenance`` (H, W) uint8, ``NOTHING`` or ``Provenance`` + 1; ``validity``
    (H, W) float32 in [0, 1], 1 where the free side of a surface that some capture saw is
    shown (a surface none saw anchors nothing); ``instance`` (H, W) int32, the number of the
    object in the proxy, 0 for the room and for nothing.
    """

    camera: Camera
    depth: np.ndarray
    normal: np.ndarray
    provenance: np.ndarray
    validity: np.ndarray
    instance: np.ndarray

    @property
    def distance(self) -> np.ndarray:
        """(H, W) float32: the length of each pixel's ray to the surface, metres, 0 for nothing."""
        return self.depth * np.linalg.norm(self.camera.rays(), axis=-1).astype(np.float32)

    @property
    def normal_camera(self) -> np.ndarray:
        """(H, W, 3) float32: the normal in the camera's frame (OpenCV axes), 0 for nothing."""
        return self.normal @ self.camera.world_from_camera[:3, :3].astype(np.float32)


class Renderer(Protocol):
    """Renders structural conditions of one geometry proxy.

    ``name`` is what the bundle, the panels and the report call it, such as "z-buffer" or
    "Cycles 4.5.15".
    """

    name: str

    def render(self, path: Sequence[Camera]) -> list[Condition]:
        """One condition a camera, at the camera's size."""
        ...


class ZBufferRenderer:
    """The default: the library's own z-buffer on the processor."""

    name = "z-buffer"

    def __init__(self, proxy: GeometryProxy, rasterizer: MeshRasterizer | None = None) -> None:
        """``rasterizer``, when given, is one made of the proxy's own vertices and faces."""
        self._rasterizer = rasterizer or MeshRasterizer(proxy.vertices, proxy.faces)
        self._faces = (
            normals_and_areas(proxy.vertices, proxy.faces)[0].astype(np.float32),
            proxy.provenance.astype(np.uint8),
            np.ascontiguousarray(proxy.support > 0),
            proxy.instance.astype(np.int32),
        )

    def render(self, path: Sequence[Camera]) -> list[Condition]:
        """See ``Renderer``."""
        return [self.condition(camera) for camera in path]

    def depth(self, camera: Camera) -> np.ndarray:
        """The proxy's planar depth (H, W) float32, metres, 0 where there is no surface."""
        return self._rasterizer.render(camera).depth

    def condition(self, camera: Camera) -> Condition:
        """The structural condition at one camera."""
        buffers = self._rasterizer.render(camera)
        lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
        rotation = np.ascontiguousarray(camera.world_from_camera[:3, :3])
        return Condition(camera, buffers.depth, *_passes(buffers.face, lens, rotation, *self._faces))


def make(name: str, proxy: GeometryProxy) -> Renderer:
    """The default renderer."""
    return ZBufferRenderer(proxy)


@parallel_kernel
def _passes(face, lens, rotation, normals, provenances, supported, instances):
    """Normal, provenance, validity and instance of the face at every pixel."""
    height, width = face.shape
    normal = np.zeros((height, width, 3), np.float32)
    provenance = np.zeros((height, width), np.uint8)
    validity = np.zeros((height, width), np.float32)
    instance = np.zeros((height, width), np.int32)
    for row in prange(height):
        y = (row + 0.5 - lens[3]) / lens[1]
        for column in range(width):
            f = face[row, column]
            if f < 0:
                continue
            x = (column + 0.5 - lens[2]) / lens[0]
            along = 0.0  # the ray's direction along the face's free side
            for axis in range(3):
                ray = rotation[axis, 0] * x + rotation[axis, 1] * y + rotation[axis, 2]
                along += normals[f, axis] * ray
            sign = np.float32(1.0) if along <= 0.0 else np.float32(-1.0)
            for axis in range(3):
                normal[row, column, axis] = sign * normals[f, axis]
            provenance[row, column] = provenances[f] + 1
            if along < 0.0 and supported[f]:
                validity[row, column] = 1.0
            instance[row, column] = instances[f]
    return normal, provenance, validity, instance

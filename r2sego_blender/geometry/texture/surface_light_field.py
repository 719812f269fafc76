"""A surface light field: what light leaves each place of a mesh, and how that differs with where it is seen from.

Wood et al. (2000), in the basis of 3DGS: each face has a rectangle of texels along its longest edge, and each texel
harmonics of the direction that it is seen in. No charts are unwrapped, and what shines is no special case.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from ...core.arrays import opened_arrays, require_between, require_indices, require_shapes, save_arrays
from ...core.cameras import Camera
from ...core.compiled import inlined, parallel_kernel, prange
from ...core.errors import GeometryError
from ...splats.harmonics import basis_values
from ..visibility.rasterizer import MeshBuffers, MeshRasterizer

DEGREES = {1: 0, 4: 1, 9: 2}
"""Number of harmonics -> their degree."""

_SAMPLES = 3  # of a pixel, across and down; one is in its middle
_MOST_TEXELS = 1 << 20  # of a face along a side: products stay whole numbers
_SHORTEST_M = 1e-9
_MOST = 1e4  # metres, and of what a harmonic may weigh
_CURE = "Make the reference room again (`python -m tools.rooms.reference`)."


@dataclass(frozen=True)
class SurfaceLightField:
    """``vertices`` (V, 3) float32 in the world, metres; ``faces`` (F, 3) int32; ``texels`` (F, 2) int32, how many
    each face has along its longest edge and across it; ``light`` (T, K, 3) float32, the K harmonics of every texel,
    face by face and row by row, of the unit direction from the camera in the world, of sRGB in [0, 1];
    ``background`` (3,) float32 sRGB, where there is no surface."""

    vertices: np.ndarray
    faces: np.ndarray
    texels: np.ndarray
    light: np.ndarray
    background: np.ndarray

    @staticmethod
    def load(file: Path) -> SurfaceLightField:
        """As ``save`` wrote it. Raises GeometryError where the file is damaged or is none."""
        with opened_arrays(file, GeometryError, "this surface light field cannot be read", _CURE) as data:
            axes = {"vertices": "V 3", "faces": "F 3", "texels": "F 2", "light": "T K 3", "background": "3"}
            arrays = {name: data[name] for name in axes}
            require_shapes(arrays, **axes)
            require_indices(len(arrays["vertices"]), faces=arrays["faces"])
            require_indices(_MOST_TEXELS, texels=arrays["texels"])
            require_between(1, None, texels=arrays["texels"])
            for name in ("vertices", "light", "background"):
                require_between(-_MOST, _MOST, **{name: arrays[name]})
            count, harmonics = arrays["light"].shape[:2]
            if harmonics not in DEGREES or arrays["texels"].astype(np.int64).prod(axis=1).sum() != count:
                raise ValueError(f"it has {count} texels of {harmonics} harmonics")
            kinds = {"faces": np.int32, "texels": np.int32}
            field = {name: values.astype(kinds.get(name, np.float32)) for name, values in arrays.items()}
        return SurfaceLightField(**field)

    def save(self, file: Path) -> None:
        """Write the arrays as an uncompressed ``.npz``; light is float16 there, finer than a picture's levels."""
        arrays = {name: getattr(self, name) for name in self.__dataclass_fields__}
        save_arrays(file, **arrays | {"light": self.light.astype(np.float16)})

    def render(self, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """Colour (H, W, 3) float32 sRGB in [0, 1], the mean of nine samples a pixel, and planar depth (H, W)
        float32 in its middle, metres, 0 where there is no surface."""
        seen = self._rasterizer.render(camera.scaled(_SAMPLES))
        harmonics = harmonics_seen(camera, self.light.shape[1])
        colour = _shade(
            seen.depth,
            seen.face,
            *_rays(camera.scaled(_SAMPLES)),
            self._charts,
            self.texels,
            self._first,
            self.light,
            harmonics,
            self.background,
            _SAMPLES,
        )
        middle = _SAMPLES // 2
        return colour, np.ascontiguousarray(seen.depth[middle::_SAMPLES, middle::_SAMPLES])

    def texels_seen(self, camera: Camera) -> tuple[np.ndarray, MeshBuffers]:
        """The index of the texel in each pixel's middle (H, W) int64, -1 for none, and the buffers behind it."""
        seen = self._rasterizer.render(camera)
        return _look_up(seen.depth, seen.face, *_rays(camera), self._charts, self.texels, self._first), seen

    @cached_property
    def _rasterizer(self) -> MeshRasterizer:
        return MeshRasterizer(self.vertices, self.faces)

    @cached_property
    def _first(self) -> np.ndarray:
        """(F,) int64: each face's first texel."""
        counts = self.texels.astype(np.int64).prod(axis=1)
        return np.cumsum(counts) - counts

    @cached_property
    def _charts(self) -> np.ndarray:
        """(F, 2, 4) float64: a world point's column and row on a face are the products with (x, y, z, 1)."""
        corner, axes, extents_m = face_frames(self.vertices, self.faces)
        scaled = axes * (self.texels / np.maximum(extents_m, _SHORTEST_M))[..., None]
        offset = -np.einsum("fai,fi->fa", scaled, corner)
        return np.ascontiguousarray(np.concatenate([scaled, offset[..., None]], axis=2))


def texel_counts(vertices: np.ndarray, faces: np.ndarray, cell_m: float) -> np.ndarray:
    """(F, 2) int32: texels of at most ``cell_m`` along each face's longest edge and across it."""
    extents_m = face_frames(vertices, faces)[2]
    return np.clip(np.ceil(extents_m / cell_m), 1, _MOST_TEXELS - 1).astype(np.int32)


def texel_middles(vertices: np.ndarray, faces: np.ndarray, texels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middles (T, 3) of all texels, metres, and the face (T,) of each."""
    corner, axes, extents_m = face_frames(vertices, faces)
    counts = texels.astype(np.int64).prod(axis=1)
    face = np.repeat(np.arange(len(faces)), counts)
    index = np.arange(len(face)) - np.repeat(np.cumsum(counts) - counts, counts)
    across = np.stack([index % texels[face, 0], index // texels[face, 0]], axis=1)
    share = (across + 0.5) / texels[face] * extents_m[face]
    return corner[face] + np.einsum("ta,tai->ti", share, axes[face]), face


def harmonics_seen(camera: Camera, count: int) -> np.ndarray:
    """(H, W, count) float32: the harmonics of the directions from the camera to its pixels' middles."""
    rays, _ = _rays(camera)
    unit = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    values = basis_values(*np.moveaxis(unit, -1, 0))[:count]
    return np.stack([np.broadcast_to(value, camera.shape) for value in values], axis=-1).astype(np.float32)


def face_frames(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of each face a corner (F, 3), unit axes (F, 2, 3) along the longest edge and across it into the face, and its
    extents (F, 2) along these, metres."""
    corners = np.asarray(vertices, np.float64)[faces]
    edges = np.roll(corners, -1, axis=1) - corners
    longest = np.linalg.norm(edges, axis=2).argmax(axis=1)[:, None, None]
    corner, along = (np.take_along_axis(values, longest, axis=1)[:, 0] for values in (corners, edges))
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along = along / np.maximum(length, _SHORTEST_M)
    away = np.roll(edges, 1, axis=1)  # from the corner after next to the corner
    inward = -np.take_along_axis(away, longest, axis=1)[:, 0]
    inward = inward - np.einsum("fi,fi->f", inward, along)[:, None] * along
    height = np.linalg.norm(inward, axis=1, keepdims=True)
    inward = inward / np.maximum(height, _SHORTEST_M)
    return corner, np.stack([along, inward], axis=1), np.concatenate([length, height], axis=1)


def _rays(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """(H, W, 3) float64: what a metre of depth is in each pixel's middle, in the world; and the camera's centre."""
    rays = camera.rays() @ camera.world_from_camera[:3, :3].T
    return np.ascontiguousarray(rays), np.ascontiguousarray(camera.world_from_camera[:3, 3])


@inlined
def _texel(depth, face, rays, centre, charts, texels, first, row, column):
    """The texel that a pixel shows, -1 for none."""
    texel = -1
    f = face[row, column]
    if f >= 0:
        x = centre[0] + depth[row, column] * rays[row, column, 0]
        y = centre[1] + depth[row, column] * rays[row, column, 1]
        z = centre[2] + depth[row, column] * rays[row, column, 2]
        u = charts[f, 0, 0] * x + charts[f, 0, 1] * y + charts[f, 0, 2] * z + charts[f, 0, 3]
        v = charts[f, 1, 0] * x + charts[f, 1, 1] * y + charts[f, 1, 2] * z + charts[f, 1, 3]
        across = min(max(int(u), 0), texels[f, 0] - 1)
        down = min(max(int(v), 0), texels[f, 1] - 1)
        texel = first[f] + across + texels[f, 0] * down
    return texel


@parallel_kernel
def _look_up(depth, face, rays, centre, charts, texels, first):
    height, width = face.shape
    found = np.full((height, width), -1, np.int64)
    for row in prange(height):
        for column in range(width):
            found[row, column] = _texel(depth, face, rays, centre, charts, texels, first, row, column)
    return found


@parallel_kernel
def _shade(depth, face, rays, centre, charts, texels, first, light, harmonics, background, samples):
    height, width, count = harmonics.shape
    image = np.zeros((height, width, 3), np.float32)
    share = np.float32(1.0 / (samples * samples))
    for row in prange(height):
        for column in range(width):
            for sample in range(samples * samples):
                texel = _texel(
                    depth,
                    face,
                    rays,
                    centre,
                    charts,
                    texels,
                    first,
                    samples * row + sample // samples,
                    samples * column + sample % samples,
                )
                for channel in range(3):
                    value = background[channel]
                    if texel >= 0:
                        value = np.float32(0.0)
                        for k in range(count):
                            value += harmonics[row, column, k] * light[texel, k, channel]
                    image[row, column, channel] += share * min(max(value, np.float32(0.0)), np.float32(1.0))
    return image

"""A surface light field from pictures of the surface: regularised least squares, texel by texel."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from ...core.cameras import Camera
from ...core.compiled import kernel
from ...core.errors import GeometryError
from ..mesh.meshes import normals_and_areas
from .surface_light_field import SurfaceLightField, harmonics_seen, texel_middles
from .texturing import continued

SAMPLES = 2
"""Of a picture's pixel, across and down."""

_EDGE_STEP, _EDGE_TRUST = 0.1, 0.03  # relative depth that makes an edge; how far its mixed colours are trusted
_NEAREST_M = 0.3
_SOLVED = 1 << 16  # texels at a time
_SLACK = 1e-5  # of a texel's weight: it only keeps sums of one direction from being singular


@dataclass
class LightSums:
    """The normal equations of every texel's harmonics: of degree ``degree``, on the mesh of ``surface``."""

    surface: SurfaceLightField
    degree: int

    def __post_init__(self) -> None:
        count, harmonics = len(self.surface.light), (self.degree + 1) ** 2
        self._products = np.zeros((count, harmonics, harmonics), np.float32)
        self._colours = np.zeros((count, harmonics, 3), np.float32)
        self._sky: list[np.ndarray] = []

    def add(self, picture: np.ndarray, camera: Camera) -> None:
        """A picture (H, W, 3) float32 sRGB in [0, 1] of the surface. Pixels at its edges hardly count, since
        they are of two surfaces; near ones count more, since they are finer."""
        texels, buffers = self.surface.texels_seen(camera.scaled(SAMPLES))
        depth = np.where(texels >= 0, buffers.depth, np.inf)
        near, far = ndimage.minimum_filter(depth, 3), ndimage.maximum_filter(depth, 3)
        trust = np.where(far <= near * (1.0 + _EDGE_STEP), 1.0, _EDGE_TRUST) / np.maximum(depth, _NEAREST_M)
        harmonics = harmonics_seen(camera, self._products.shape[1])
        _add(texels, trust.astype(np.float32), harmonics, picture, SAMPLES, self._products, self._colours)
        empty = np.isinf(near).reshape(camera.height, SAMPLES, camera.width, SAMPLES).all(axis=(1, 3))
        self._sky.append(picture[empty])

    def fitted(self, ridge: float) -> SurfaceLightField:
        """The light field of least squares.

        ``ridge`` draws all but the constant harmonic to 0. Texels that no picture saw go on from their
        surroundings that face the same way. Raises GeometryError where no picture saw the surface.
        """
        products, colours = self._products, self._colours
        weight = products[:, 0, 0]
        seen = weight > 0.0
        if not seen.any():
            raise GeometryError("no picture sees the surface", where="surface light field", cure="Check the poses.")
        light = np.zeros_like(colours)
        penalty = ridge * np.eye(products.shape[1], dtype=np.float32)
        penalty[0, 0] = 0.0
        for some in np.array_split(np.flatnonzero(seen), max(1, int(seen.sum()) // _SOLVED)):
            slack = _SLACK * weight[some, None, None] * np.eye(len(penalty), dtype=np.float32)
            light[some] = np.linalg.solve(products[some] + penalty + slack, colours[some])
        surface = self.surface
        middles, face = texel_middles(surface.vertices, surface.faces, surface.texels)
        normals = normals_and_areas(surface.vertices, surface.faces)[0][face]
        if not seen.all():
            flat = light.reshape(len(light), -1)
            light[~seen] = continued(middles, normals, flat, seen).reshape(-1, *light.shape[1:])
        sky = np.concatenate(self._sky)
        background = sky.mean(axis=0, dtype=np.float64) if len(sky) else np.zeros(3)
        return replace(surface, light=light, background=background.astype(np.float32))


@kernel
def _add(texels, trust, harmonics, picture, samples, products, colours):
    height, width, count = harmonics.shape
    for row in range(height * samples):
        for column in range(width * samples):
            texel = texels[row, column]
            if texel < 0:
                continue
            y, x = row // samples, column // samples
            for i in range(count):
                share = trust[row, column] * harmonics[y, x, i]
                for j in range(count):
                    products[texel, i, j] += share * harmonics[y, x, j]
                for channel in range(3):
                    colours[texel, i, channel] += share * picture[y, x, channel]

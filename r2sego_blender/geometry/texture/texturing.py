"""Baking: the captures' colours on the texels of an unwrapped mesh.

A capture gives a texel colour where the mesh's own depth says that it sees it. The best few
are blended, by how squarely and finely they see the surface. What none sees continues its
surroundings in space, so colours agree where charts part, and the rest of the texture is
filled so that smaller mip levels mix no foreign colour in.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from ...config.settings import TextureSettings
from ...core.cameras import Camera
from ...core.compiled import kernel, parallel_kernel, prange
from ...core.errors import GeometryError
from ...core.images import to_uint8
from ...core.progress import SILENT, Progress
from ..mesh.meshes import normals_and_areas
from ..visibility.projection import NEAR_M, depth_of, pixel_of
from ..visibility.rasterizer import MeshRasterizer
from .texels import texel_map
from .textured_mesh import TexturedMesh
from .unwrapping import UnwrappedMesh

_ROUGHNESS_M = 0.005  # of the mesh: depth may differ by this at any distance
_LEAST_COSINE = 0.05  # of a view so slanted that a pixel of error is many texels
_EDGE_STEP = 0.05  # relative depth by which something nearer makes an edge
_EDGE_TRUST = 0.02  # of background beside an edge, against 1
_BEST_POWER = 4.0  # how much the best capture outweighs the next: sharp before smooth
_FILL_CELL_M = 0.02
_FILL_NEIGHBOURS = 8
_FILL_TURN_M = 0.3  # a right angle between normals counts as this much distance and more
_FILL_SLACK = 1.0  # the neighbours may be this share farther than the nearest: four times as fast


def bake(
    mesh: UnwrappedMesh,
    images: Sequence[np.ndarray],
    cameras: Sequence[Camera],
    settings: TextureSettings,
    progress: Progress = SILENT,
    shown: Sequence[np.ndarray] | None = None,
) -> TexturedMesh:
    """The mesh with a texture of ``settings.size_px`` baked from the captures.

    ``images`` (H, W, 3) float32 in [0, 1], with one exposure, belong to ``cameras`` one by
    one, as do ``shown`` (H, W) bool: the pixels that may be used, all by default. Raises
    GeometryError when no capture sees any of the mesh.
    """
    texels = texel_map(mesh.uvs, mesh.faces, settings.size_px, settings.padding_px / 2)
    used = texels.face >= 0
    points = texels.interpolated(mesh.vertices, mesh.faces)
    normals = normals_and_areas(mesh.vertices, mesh.faces)[0].astype(np.float32)[texels.face[used]]
    colours, seen = seen_colours(points, normals, mesh, images, cameras, settings, progress, shown)
    if not seen.any():
        raise GeometryError("no capture sees any of the mesh", where="texture", cure="Check the captures' poses.")
    colours[~seen] = continued(points, normals, colours, seen)
    texture = np.zeros((*used.shape, 3), np.float32)
    texture[used] = colours
    texture = filled(texture, used)
    inside = texels.inside[used]
    share = float((seen & inside).sum() / max(inside.sum(), 1))
    return TexturedMesh(mesh.vertices, mesh.faces, mesh.uvs, to_uint8(texture), mesh.method, share)


def seen_colours(
    points: np.ndarray,
    normals: np.ndarray,
    mesh: UnwrappedMesh,
    images: Sequence[np.ndarray],
    cameras: Sequence[Camera],
    settings: TextureSettings,
    progress: Progress = SILENT,
    shown: Sequence[np.ndarray] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Colours (n, 3) float32 of surface points (n, 3) with unit normals, and which are seen (n,)."""
    rasterizer = MeshRasterizer(mesh.vertices, mesh.faces)
    best = min(settings.best_captures, len(cameras))
    quality = np.zeros((len(points), best + 1), np.float32)
    colour = np.zeros((len(points), best + 1, 3), np.float32)
    window = 2 * settings.edge_px + 1
    shown = [np.ones(camera.shape, bool) for camera in cameras] if shown is None else shown
    views = zip(images, cameras, shown, strict=True)
    for image, camera, usable in progress.track(views, "Baking", len(cameras)):
        depth = rasterizer.render(camera).depth
        solid = np.where(depth > 0, depth, np.float32(np.inf))
        nearest = ndimage.minimum_filter(solid, size=window, mode="nearest")
        trust = np.where(nearest < solid * (1 - _EDGE_STEP), np.float32(_EDGE_TRUST), np.float32(1))
        trust[~usable] = 0
        _see(
            points,
            normals,
            camera.camera_from_world[:3],
            camera.centre.copy(),
            np.array([camera.fx, camera.fy, camera.cx, camera.cy]),
            depth,
            trust,
            np.ascontiguousarray(image, np.float32),
            settings.depth_tolerance,
            settings.border_px,
            quality,
            colour,
        )
    return _blended(quality, colour, best), quality[:, 0] > 0


@parallel_kernel
def _see(points, normals, pose, centre, lens, depth, trust, image, tolerance, border_px, quality, colour):
    """Put what one capture sees among the best so far, which ``quality`` (n, k) sorts."""
    height, width = depth.shape
    for i in prange(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        ahead = depth_of(pose, x, y, z)
        if ahead <= NEAR_M:
            continue
        u, v = pixel_of(pose, lens, x, y, z, ahead)
        if not (0.0 <= u < width and 0.0 <= v < height):
            continue
        row, column = int(v), int(u)
        if abs(depth[row, column] - ahead) > tolerance * ahead + _ROUGHNESS_M:
            continue
        ox, oy, oz = centre[0] - x, centre[1] - y, centre[2] - z
        cosine = normals[i, 0] * ox + normals[i, 1] * oy + normals[i, 2] * oz
        away = np.sqrt(ox * ox + oy * oy + oz * oz)
        cosine /= away
        if cosine < _LEAST_COSINE:
            continue
        # Pixels a square metre of the surface takes, up to the constants all captures share.
        value = cosine * lens[0] * lens[1] * away / ahead**3 * trust[row, column]
        if border_px > 0.0:
            value *= min(max(min(min(u, width - u), min(v, height - v)) / border_px, 0.02), 1.0)
        _insert(i, np.float32(value), image, u, v, quality, colour)


@kernel
def _insert(i, value, image, u, v, quality, colour):
    place = quality.shape[1]
    while place > 0 and quality[i, place - 1] < value:
        place -= 1
    if place == quality.shape[1]:
        return
    for k in range(quality.shape[1] - 1, place, -1):
        quality[i, k] = quality[i, k - 1]
        for c in range(3):
            colour[i, k, c] = colour[i, k - 1, c]
    quality[i, place] = value
    height, width = image.shape[:2]
    a = min(max(u - 0.5, 0.0), width - 1.0)
    b = min(max(v - 0.5, 0.0), height - 1.0)
    a0, b0 = min(int(a), width - 2), min(int(b), height - 2)
    fa, fb = np.float32(a - a0), np.float32(b - b0)
    for c in range(3):
        upper = image[b0, a0, c] * (1 - fa) + image[b0, a0 + 1, c] * fa
        lower = image[b0 + 1, a0, c] * (1 - fa) + image[b0 + 1, a0 + 1, c] * fa
        colour[i, place, c] = upper * (1 - fb) + lower * fb


def _blended(quality: np.ndarray, colour: np.ndarray, best: int) -> np.ndarray:
    """The best captures' mean; the one after them fades to nothing, so no seam shows where they change."""
    weight = np.maximum(quality[:, :best] - quality[:, best:], 0) / np.maximum(quality[:, :1], 1e-12)
    weight = weight**_BEST_POWER
    weight[:, 0] = np.maximum(weight[:, 0], 1e-6)
    weight /= weight.sum(1, keepdims=True)
    return np.einsum("ij,ijk->ik", weight, colour[:, :best])


def continued(points: np.ndarray, normals: np.ndarray, colours: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Values (m, C) for the unseen points: those of the nearest seen surface that faces the same way."""
    place = np.concatenate([points, _FILL_TURN_M * normals], axis=1)
    cell = _numbered(np.floor(place[seen] / _FILL_CELL_M).astype(np.int64))
    count = np.bincount(cell)
    known = np.concatenate([place, colours], axis=1)[seen]
    known = np.stack([np.bincount(cell, column) for column in known.T], axis=1) / count[:, None]
    neighbours = [*range(1, min(_FILL_NEIGHBOURS, len(known)) + 1)]
    distance, near = cKDTree(known[:, :6]).query(place[~seen], k=neighbours, eps=_FILL_SLACK, workers=-1)
    weight = 1.0 / (distance**2 + _FILL_CELL_M**2) ** 2
    weight /= weight.sum(1, keepdims=True)
    return np.einsum("ij,ijk->ik", weight, known[near, 6:])


def _numbered(cells: np.ndarray) -> np.ndarray:
    """(n,) the number of each distinct row of (n, k) integers."""
    key = np.zeros(len(cells), np.int64)
    for column in cells.T:  # as digits of one number, packed anew where they would overflow
        column = column - column.min()
        base = int(column.max()) + 1
        if (int(key.max()) + 1) * base >= 2**62:
            key = np.unique(key, return_inverse=True)[1].ravel()
        key = key * base + column
    return np.unique(key, return_inverse=True)[1].ravel()


def filled(texture: np.ndarray, known: np.ndarray) -> np.ndarray:
    """(S, S, 3) float32: unknown texels by push-pull from the known ones around them."""
    weight: np.ndarray = known.astype(np.float32)
    levels: list[tuple[np.ndarray, np.ndarray]] = [(texture * weight[..., None], weight)]
    while min(levels[-1][1].shape) > 1:
        colour, weight = levels[-1]
        height, width = (weight.shape[0] + 1) // 2, (weight.shape[1] + 1) // 2
        colour, weight = (cv2.resize(v, (width, height), interpolation=cv2.INTER_AREA) for v in (colour, weight))
        levels.append((colour, weight))
    below: np.ndarray | None = None
    for colour, weight in reversed(levels):
        mean = colour / np.maximum(weight, 1e-9)[..., None]
        if below is not None:
            coarse = cv2.resize(below, weight.shape[::-1], interpolation=cv2.INTER_LINEAR)
            mean = np.where(weight[..., None] > 0, mean, coarse)
        below = mean
    assert below is not None
    return np.where(known[..., None], texture, below)

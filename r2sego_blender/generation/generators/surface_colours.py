"""Colours of the room's surfaces, continued in 3D to where no capture saw them.

What the captures show is laid into six stacks of thin layers, one for each way along the
room's own axes that a surface can face. Within a layer, colours spread as in push-pull:
coarse cells tell what finer ones do not know. So a floor is continued by that floor and
not by the table above it. The colour of a point depends on where it lies and how its
surface faces and on no view: it is the same in all frames and all clips.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core.cameras import Camera
from ...core.compiled import inlined, kernel, parallel_kernel, prange

_CELL_M, _LAYER_M = 0.05, 0.08  # along the layers, and their thickness
_MOST_CELLS = 160  # along an axis: cells and layers of larger rooms are larger
_MARGIN_M = 0.3
_STRAY = 0.002  # share of the points at either end of an axis that do not make the room larger
_STRIDE_PX = 2  # of the pixels used: cells are far larger than pixels
_NORMAL_STEP_PX = 2
_LEVEL = 0.3  # the largest vertical part of a wall's normal
_LAYER_REACH = 1.5  # layers at which another layer's colour counts a quarter
_STRONGEST_LAYER = np.float32(4.0)
_SMALLEST = np.float32(1e-6)
_LEAST_FACING = np.float32(0.02)  # of a normal's square; ways that a surface faces less are left out


@dataclass(frozen=True)
class _Stack:
    """Layers across one axis: ``colour`` (U, V, L, 3) float32 of the cells' corners.

    ``axes`` are u, v and the axis across, ``sign`` the way that the layers face along it;
    ``step`` (3,) float32 is the distance of corners, metres.
    """

    axes: tuple[int, int, int]
    sign: float
    step: np.ndarray
    colour: np.ndarray


class SurfaceColours:
    """Every surface point's colour, as far as the captures can tell."""

    def __init__(
        self,
        images: Sequence[np.ndarray],
        cameras: Sequence[Camera],
        depths: Sequence[np.ndarray],
        trusts: Sequence[np.ndarray],
    ) -> None:
        """``images`` (H, W, 3) of one exposure with the proxy's planar ``depths`` (H, W), metres, 0
        where there is none, and ``trusts`` (H, W) in [0, 1], how far each pixel may be used.
        """
        points, normals, colours, weights = _samples(images, cameras, depths, trusts)
        self._room_from_world = _room_from_world(normals)
        points, normals = points @ self._room_from_world.T, normals @ self._room_from_world.T
        low, high = np.quantile(points, [_STRAY, 1.0 - _STRAY], axis=0) if len(points) else np.zeros((2, 3))
        self._low = (low - _MARGIN_M).astype(np.float32)
        size = high - low + 2.0 * _MARGIN_M
        scale = max(1.0, float(size.max()) / (_CELL_M * _MOST_CELLS))
        step = np.array([_CELL_M * scale, _CELL_M * scale, _LAYER_M * scale], np.float32)
        overall = (weights[:, None] * colours).sum(axis=0) / max(weights.sum(), _SMALLEST)
        self._stacks = []
        for across in range(3):
            u, v = (a for a in range(3) if a != across)
            axes = (u, v, across)
            corners = np.ceil(size[list(axes)] / step).astype(int) + 1
            places = (points - self._low)[:, axes] / step
            for sign in (1.0, -1.0):
                facing = np.square(np.maximum(np.float32(sign) * normals[:, across], 0.0)) * weights
                known = np.zeros((*corners, 4), np.float32)
                _splat(places, facing, colours, known)
                self._stacks.append(_Stack(axes, sign, step, spread(known, overall)))

    def at(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(n, 3) float32 colours of world points (n, 3) on surfaces with unit normals (n, 3)."""
        points = (points.astype(np.float32) @ self._room_from_world.T) - self._low
        normals = normals.astype(np.float32) @ self._room_from_world.T
        colour = np.zeros((len(points), 3), np.float32)
        total = np.full((len(points), 1), _SMALLEST)
        for stack in self._stacks:
            facing = np.square(np.maximum(np.float32(stack.sign) * normals[:, stack.axes[2]], 0.0))
            chosen = np.flatnonzero(facing > _LEAST_FACING)
            places = np.ascontiguousarray(points[chosen][:, stack.axes] / stack.step)  # compiled for one layout
            share = facing[chosen, None]
            colour[chosen] += share * _sample(stack.colour, places)
            total[chosen] += share
        return colour / total


def spread(known: np.ndarray, overall: np.ndarray) -> np.ndarray:
    """(U, V, L, 3) float32: cells that know their colour keep it, others take their layer's.

    ``known`` (U, V, L, 4) float32 holds sums of colours and weights. Colours spread within
    a layer (the first two axes). A layer without any takes those of the layers about it,
    and all of them, where nothing is known at all, ``overall`` (3,).
    """
    levels = [known]
    while max(levels[-1].shape[:2]) > 1:
        level = levels[-1]
        # no cell counts more than once, else much photographed ones would rule from afar
        weight = np.minimum(level[..., 3:], np.float32(1.0))
        level = np.concatenate([_mean(level) * weight, weight], axis=-1)
        level = np.pad(level, ((0, level.shape[0] % 2), (0, level.shape[1] % 2), (0, 0), (0, 0)))
        levels.append(level[::2, ::2] + level[1::2, ::2] + level[::2, 1::2] + level[1::2, 1::2])
    top = levels[-1][0, 0]
    apart = np.subtract.outer(np.arange(len(top)), np.arange(len(top)))
    near = np.minimum(top[:, 3], _STRONGEST_LAYER) / np.square(1.0 + np.square(apart / _LAYER_REACH))
    near = near.astype(np.float32)
    filled = (near @ _mean(top) + _SMALLEST * overall) / (near.sum(axis=1, keepdims=True) + _SMALLEST)
    filled = filled[None, None]
    for level in levels[-2::-1]:
        weight = np.minimum(level[..., 3:], np.float32(1.0))
        filled = weight * _mean(level) + (1 - weight) * _finer(filled, level.shape)
    return np.ascontiguousarray(filled, np.float32)


def _mean(sums: np.ndarray) -> np.ndarray:
    return sums[..., :3] / np.maximum(sums[..., 3:], _SMALLEST)


def _finer(coarse: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """``coarse`` at twice as many cells along both axes of the layers, bilinear."""
    for axis in (0, 1):
        index = np.arange(shape[axis])
        own = index // 2
        beside = np.clip(own + np.where(index % 2, 1, -1), 0, coarse.shape[axis] - 1)
        coarse = np.float32(0.75) * coarse.take(own, axis) + np.float32(0.25) * coarse.take(beside, axis)
    return coarse


def _samples(
    images: Sequence[np.ndarray], cameras: Sequence[Camera], depths: Sequence[np.ndarray], trusts: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points, normals, colours (n, 3) and weights (n,), float32, of a grid of trusted pixels."""
    grid = (slice(_STRIDE_PX // 2, None, _STRIDE_PX),) * 2
    found = []
    for image, camera, depth, trust in zip(images, cameras, depths, trusts, strict=True):
        points = camera.unproject(depth)
        usable = (depth[grid] > 0.0) & (trust[grid] > 0.0)
        normals = _normals(points, camera.centre)[grid][usable]
        parts = points[grid][usable], normals, image[grid][usable], trust[grid][usable]
        found.append([part.astype(np.float32) for part in parts])
    points, normals, colours, weights = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return points, normals, colours, weights


def _normals(points: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """(H, W, 3) unit normals of the surface through points (H, W, 3), towards ``centre``."""
    k = _NORMAL_STEP_PX
    wide = np.pad(points, ((k, k), (k, k), (0, 0)), mode="edge")
    along_row = wide[k:-k, 2 * k :] - wide[k:-k, : -2 * k]
    along_column = wide[2 * k :, k:-k] - wide[: -2 * k, k:-k]
    normal = np.cross(along_column, along_row)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    away = np.einsum("hwc,hwc->hw", normal, points - centre) > 0.0
    return np.where(away[..., None], -normal, normal)


def _room_from_world(normals: np.ndarray) -> np.ndarray:
    """(3, 3) float32: the turn about the vertical that lays the walls along the axes."""
    walls = normals[np.abs(normals[:, 2]) < _LEVEL].astype(np.float64)
    angle = np.arctan2(walls[:, 1], walls[:, 0])
    yaw = np.angle(np.exp(4j * angle).sum()) / 4.0  # a quarter turn lays them along the axes again
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]], np.float32)


@inlined
def _corner(shape, a, b, c):
    """The lowest corner of the cell at a place within a grid, as it is clamped to it."""
    last = np.float32(1.001)
    a = min(max(a, np.float32(0.0)), np.float32(shape[0]) - last)
    b = min(max(b, np.float32(0.0)), np.float32(shape[1]) - last)
    c = min(max(c, np.float32(0.0)), np.float32(shape[2]) - last)
    return np.int64(a), np.int64(b), np.int64(c), a, b, c


@inlined
def _share(corner, x, y, z, a, b, c):
    """The trilinear share that the corner (x, y, z from the lowest) has of a place."""
    one = np.float32(1.0)
    fa, fb, fc = a - corner[0], b - corner[1], c - corner[2]
    share = fa if x else one - fa
    share *= fb if y else one - fb
    return np.float32(share * (fc if z else one - fc))


@kernel
def _splat(places, weights, colours, known):
    """Add the samples at ``places`` (n, 3), in cells, to their corners; strays are left out."""
    for i in range(len(places)):
        place = places[i]
        outside = weights[i] <= 0.0
        for axis in range(3):
            outside |= not 0.0 <= place[axis] <= known.shape[axis] - 1
        if outside:
            continue
        a0, b0, c0, a, b, c = _corner(known.shape, place[0], place[1], place[2])
        for x in range(2):
            for y in range(2):
                for z in range(2):
                    w = weights[i] * _share((a0, b0, c0), x, y, z, a, b, c)
                    for k in range(3):
                        known[a0 + x, b0 + y, c0 + z, k] += w * colours[i, k]
                    known[a0 + x, b0 + y, c0 + z, 3] += w


@parallel_kernel
def _sample(colour, places):
    """(n, 3) float32: ``colour`` at ``places`` (n, 3), in cells, trilinear; beyond it its border's."""
    out = np.zeros((len(places), 3), np.float32)
    for i in prange(len(places)):
        a0, b0, c0, a, b, c = _corner(colour.shape, places[i, 0], places[i, 1], places[i, 2])
        for x in range(2):
            for y in range(2):
                for z in range(2):
                    w = _share((a0, b0, c0), x, y, z, a, b, c)
                    for k in range(3):
                        out[i, k] += w * colour[a0 + x, b0 + y, c0 + z, k]
    return out

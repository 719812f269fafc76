"""Where the next photographs are worth most: next best views of what the asset lacks and no capture shows.

Points of the candidates' pixels that are not available stand for it, weighted by the candidate's
deficit. Photographs are tried where the robot was, which is free floor, as high, as inclined and
with the same lens as the captures, and taken greedily (Pito, 1999).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..core.cameras import Camera, look_at
from ..geometry.mesh.meshes import normals_and_areas
from ..geometry.proxy.proxy import GeometryProxy
from ..geometry.visibility.face_sight import STEEP, face_sight
from ..geometry.visibility.point_visibility import looked_up
from ..geometry.visibility.rasterizer import MeshRasterizer
from .photographs import PhotographToTake

_PHOTOGRAPHS = 3
_LEAST_SHARE = 0.08  # of what is lacking: a photograph that shows less is not worth the walk
_OVERLAP = 0.15  # share of its pixels that others show too, so that it can be registered to them
_VIEWS, _VIEW_SIDE_PX = 48, 32
_PLACES, _HEADINGS, _PHOTOGRAPH_SIDE_PX = 16, 12, 64
_NEAREST_M, _FARTHEST_M = 0.4, 5.0
_OPEN_M = 2.5  # how far off something is looked for where the proxy has no surface
_BEHIND = 1.05  # of the depth that is shown: what lies farther is hidden


def photographs_to_take(
    candidates: Sequence[Camera], deficit: np.ndarray, proxy: GeometryProxy, captures: Sequence[Camera]
) -> tuple[float, tuple[PhotographToTake, ...]]:
    """What the captures lack, a share in [0, 1] of the candidates' missing pixels, and up to three
    photographs that show most of it, best first.

    ``deficit`` (M,) is the candidates' u. Deterministic.
    """
    rasterizer = MeshRasterizer(proxy.vertices, proxy.faces)
    sight = face_sight(proxy.vertices, proxy.faces, captures)
    shown_well = (proxy.support > 0) & (sight.cosine >= STEEP)
    points, normals, weights, missing = _lacking(candidates, deficit, rasterizer, proxy, shown_well)
    if not weights.any() or not captures:  # nothing is out of sight, or the asset shows all of it already
        return 0.0, ()
    cameras, sees = [], []
    for camera in _tried(candidates, captures):
        buffers = rasterizer.render(camera)
        if buffers.of_face(shown_well, False).mean() >= _OVERLAP:
            cameras.append(camera)
            sees.append(_seen(points, normals, camera, buffers.depth))
    left, total = weights.copy(), weights.sum()
    taken: list[PhotographToTake] = []
    while cameras and len(taken) < _PHOTOGRAPHS:
        gains = np.array([left[one].sum() for one in sees]) / total
        best = int(gains.argmax())
        if gains[best] < _LEAST_SHARE:
            break
        taken.append(PhotographToTake(captures[0].at(cameras[best].world_from_camera), float(gains[best])))
        left[sees[best]] = 0.0
    return float(total / max(missing, 1e-12)), tuple(taken)


def _lacking(
    candidates: Sequence[Camera],
    deficit: np.ndarray,
    rasterizer: MeshRasterizer,
    proxy: GeometryProxy,
    shown_well: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Points (P, 3) that are not shown well, with the normals (P, 3) of their surface, 0 for none,
    and weights (P,); and the weight of all pixels."""
    points, normals, weights, missing = [np.empty((0, 3))], [np.empty((0, 3))], [np.empty(0)], 0.0
    facing, _ = normals_and_areas(proxy.vertices, proxy.faces)
    for index in np.unique(np.linspace(0, len(candidates) - 1, _VIEWS).astype(np.int64)) if candidates else ():
        small = candidates[index].fitted(_VIEW_SIDE_PX)
        buffers = rasterizer.render(small)
        missing += deficit[index] * buffers.depth.size
        normal = buffers.of_face(facing)
        back = (normal * (small.unproject(np.ones_like(buffers.depth)) - small.centre)).sum(axis=-1) > 0.0
        lacks = (buffers.face < 0) | ~buffers.of_face(shown_well, False)
        lacks &= ~back & (buffers.depth < _FARTHEST_M)
        depth = np.where(buffers.face < 0, np.float32(_OPEN_M), buffers.depth)
        points.append(small.unproject(depth)[lacks])
        normals.append(normal[lacks])
        weights.append(np.full(int(lacks.sum()), deficit[index]))
    return np.concatenate(points), np.concatenate(normals), np.concatenate(weights), missing


def _tried(candidates: Sequence[Camera], captures: Sequence[Camera]) -> list[Camera]:
    """Photographs all around from places apart, small."""
    height_m = float(np.median([camera.centre[2] for camera in captures]))
    upwards = float(np.median([camera.forward[2] for camera in captures]))
    rise = math.tan(math.asin(min(1.0, max(-1.0, upwards))))  # straight down rounds to beyond 1
    places = np.array([camera.centre[:2] for camera in candidates])
    chosen = [0]
    away = np.linalg.norm(places - places[0], axis=1)
    while len(chosen) < _PLACES and away.max() > _NEAREST_M:  # the farthest from all before
        chosen.append(int(away.argmax()))
        away = np.minimum(away, np.linalg.norm(places - places[chosen[-1]], axis=1))
    lens, cameras = captures[0].fitted(_PHOTOGRAPH_SIDE_PX), []
    for place in places[chosen]:
        centre = np.array([*place, height_m])
        for yaw in 2.0 * math.pi * np.arange(_HEADINGS) / _HEADINGS:
            cameras.append(lens.at(look_at(centre, centre + np.array([math.cos(yaw), math.sin(yaw), rise]))))
    return cameras


def _seen(points: np.ndarray, normals: np.ndarray, camera: Camera, depth: np.ndarray) -> np.ndarray:
    """(P,) bool: the points that a photograph would show well."""
    seen, z, shown = looked_up(points, camera, depth)
    clear = (z > _NEAREST_M) & (z < _FARTHEST_M) & ((shown == 0.0) | (z < shown * _BEHIND))
    towards = camera.centre - points[seen]
    cosine = (normals[seen] * towards).sum(axis=1) / np.linalg.norm(towards, axis=1)
    seen[seen] = clear & ((cosine >= STEEP) | ~normals[seen].any(axis=1))
    return seen

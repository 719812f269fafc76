"""Bounds of the room that stereo could not triangulate, found by sweeping planes.

A wall behind most captures, or a ceiling in the corner of a few, gives too few points for a
plane. But rooms close along few directions: across from a wall that is known stands another,
and over the floor lies a ceiling. A plane of such a direction is moved outwards, and at each
offset the captures are asked how alike they look when carried onto it, over all pixels that
no trusted depth explains (plane sweeping, Collins 1996, with one plane for all pixels). The
offset is taken when it convinces by far; else, as where nobody looked, the room stays open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ...captures.capture import Capture
from ...config.settings import Settings
from ...core.cameras import Camera
from ...core.compiled import inlined, parallel_kernel, prange
from ...core.images import resize
from ..stereo.evidence import FREE_MARGIN, KnownDepth
from ..stereo.observed_geometry import ObservedGeometry
from ..stereo.stereo import DepthMap
from .completion import overlapping, trusted_depth
from .planes import RoomPlanes

_STEP_M = 0.02  # between offsets that are tried
_FINE_STEP_M = 0.005  # between those tried around the best of them
_STRIDE_PX = 6  # between pixels that are asked
_MOST_OTHERS = 12  # captures that each is compared with
_SAME_SIDE = 0.9  # cosine between normals of bounds on the same side of the room
_SAME_DIRECTION = 0.98  # and between directions of which one need be tried
_ALIKE = 0.5  # correlation from which a pixel speaks for an offset, and below against it
_DISTINCT = 1.5  # times the evidence of any other peak, that of the best must be
_WIDEST_PEAK_M = 1.0  # a peak may be this wide where it has fallen by that factor
_LEAST_EVIDENCE = 10.0  # in pixels exactly alike; where there is no bound, hardly one is
_HIDDEN_FROM_M = 0.03  # how far behind another bound a point is out of the room
_PATCH_RADIUS_PX, _PATCH_STEP_PX = 6, 2
_LEAST_VARIANCE = 4e-6  # of grey levels: below this there is nothing but quantisation
_NEAREST_M = 0.3
_LARGEST_EXTENT_M = 20.0


def with_missing_bounds(
    planes: RoomPlanes,
    captures: Sequence[Capture],
    depth_maps: Sequence[DepthMap],
    observed: ObservedGeometry,
    settings: Settings,
) -> RoomPlanes:
    """``planes`` and the bounds that weak evidence adds to their envelope, ceiling first.

    Tried are the level plane over the floor and, for every wall of the envelope, the walls
    opposite and square to it, where no bound of this direction is known. An added bound has
    all cameras and ``settings.proxy.envelope_share`` of the observed points on its free
    side, and more captures speak for it than look through it. Deterministic.
    """
    points = np.asarray(observed.points, np.float64).reshape(-1, 3)
    if not len(points):
        return planes
    views = [
        _View.of(*view) for view in zip(captures, depth_maps, trusted_depth(depth_maps, settings.stereo), strict=True)
    ]
    centres = np.array([view.camera.centre for view in views])
    compared = [(view, overlapping(index, views, _MOST_OTHERS)) for index, view in enumerate(views)]
    for normal in _directions(planes.envelope):
        if (planes.envelope.normals @ normal > _SAME_SIDE).any():
            continue
        nearest = min(
            np.quantile(points @ normal, 1 - settings.proxy.envelope_share),
            float((centres @ normal).min()) - _NEAREST_M,
        )
        extent = min(max(np.ptp(points @ normal), 1.0), _LARGEST_EXTENT_M)
        offset = _swept(compared, planes.envelope, normal, nearest + 2 * _STEP_M, extent)
        if offset is not None:
            planes = _with_bound(planes, normal, offset, points, settings.proxy.plane_tolerance_m)
    return planes


@dataclass(frozen=True)
class _View:
    """A capture at the size of its depth map, in grey, with its trusted depth."""

    camera: Camera
    grey: np.ndarray
    known: np.ndarray

    @staticmethod
    def of(capture: Capture, depth_map: DepthMap, trusted: KnownDepth) -> _View:
        image = resize(capture.image(), depth_map.camera.width, depth_map.camera.height)
        return _View(trusted.camera, cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), trusted.depth)


def _directions(envelope: RoomPlanes) -> list[np.ndarray]:
    """Inward normals that bounds may have: down, then against and square to the walls."""
    walls = envelope.normals[np.abs(envelope.normals[:, 2]) < 1e-6]
    square = np.stack([-walls[:, 1], walls[:, 0], walls[:, 2]], axis=1)
    directions = [np.array([0.0, 0.0, -1.0])]
    for normal in np.concatenate([-walls, square, -square]):
        if (np.array(directions) @ normal < _SAME_DIRECTION).all():
            directions.append(normal)
    return directions


_Compared = Sequence[tuple[_View, Sequence[_View]]]


def _with_bound(
    planes: RoomPlanes, normal: np.ndarray, offset: float, points: np.ndarray, tolerance_m: float
) -> RoomPlanes:
    on = int((np.abs(points @ normal - offset) < tolerance_m).sum())
    return RoomPlanes(
        np.concatenate([planes.normals, normal[None]]),
        np.append(planes.offsets, offset),
        np.append(planes.inliers, on),
        np.append(planes.bounding, True),
    )


def _swept(
    compared: _Compared, envelope: RoomPlanes, normal: np.ndarray, nearest: float, extent: float
) -> float | None:
    """The offset n.x = d, from ``nearest`` outwards, that convinces; None when none does."""
    offsets = nearest - _STEP_M * np.arange(int(extent / _STEP_M) + 1)
    evidence, through = _evidence(compared, envelope, normal, offsets)
    best = int(np.argmax(evidence))
    # The best at the inner end is the foot of something that begins before it.
    if best == 0 or evidence[best] < _LEAST_EVIDENCE or through[best] > evidence[best]:
        return None
    peak = np.flatnonzero(evidence > evidence[best] / _DISTINCT)
    if len(peak) <= np.ptp(peak) or len(peak) > _WIDEST_PEAK_M / _STEP_M:
        return None
    fine = offsets[best] + np.arange(-_STEP_M, _STEP_M + 1e-9, _FINE_STEP_M)
    # A nearer plane hides more: the same pixels must say which offset is the best.
    return float(fine[np.argmax(_evidence(compared, envelope, normal, fine, same_pixels=True)[0])])


def _evidence(
    compared: _Compared, envelope: RoomPlanes, normal: np.ndarray, offsets: np.ndarray, same_pixels: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """For each offset (D,) how much more alike captures look on the plane than on the bounds
    known behind it, or than ``_ALIKE``, summed over pixels; and the (D,) number of pixels
    for which a capture's trusted depth lies beyond the plane. With ``same_pixels`` only those
    count that are compared at every offset."""
    evidence, through = np.zeros(len(offsets)), np.zeros(len(offsets))
    candidates = np.broadcast_to(normal, (len(offsets), 3)), offsets
    for view, others in compared:
        pixels = _unexplained(view)
        if not others or not len(pixels):
            continue
        known, _ = _likeness_on(view, others, pixels, envelope, envelope.normals, envelope.offsets)
        like, beyond = _likeness_on(view, others, pixels, envelope, *candidates)
        gain = like - np.maximum(known.max(0, initial=-2.0), _ALIKE)
        counts = like > -2.0
        if same_pixels:
            counts &= counts.all(0)
        evidence += np.where(counts, gain, 0.0).sum(1) / (1.0 - _ALIKE)
        through += beyond.sum(1)
    return evidence, through


def _likeness_on(
    view: _View,
    others: Sequence[_View],
    pixels: np.ndarray,
    envelope: RoomPlanes,
    normals: np.ndarray,
    offsets: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """For planes (D, 3), (D,) and pixels (N, 2): the best correlation (D, N) with another
    capture, -2 without one, and whether some capture looks through, bool."""
    axes = view.camera.world_from_camera[:3, :3] @ np.linalg.inv(view.camera.matrix)
    away = normals @ view.camera.centre - offsets
    rows = -(normals @ axes) / np.maximum(away, 1e-3)[:, None]
    onto = np.array([[_homography(view.camera, other.camera, row) for other in others] for row in rows])
    inside = envelope.normals @ view.camera.centre - envelope.offsets + _HIDDEN_FROM_M
    bounds = np.column_stack([envelope.normals @ axes, inside])
    like = np.full((len(rows), len(pixels)), -2.0, np.float32)
    beyond = np.zeros(like.shape, np.bool_)
    _compare(
        view.grey,
        pixels,
        rows,
        bounds,
        onto,
        tuple(other.grey for other in others),
        tuple(other.known for other in others),
        like,
        beyond,
    )
    return like, beyond


def _unexplained(view: _View) -> np.ndarray:
    """(N, 2) int64 columns and rows of pixels without trusted depth that have some texture."""
    side = (2 * _PATCH_RADIUS_PX + 1,) * 2
    mean, square = cv2.boxFilter(view.grey, -1, side), cv2.sqrBoxFilter(view.grey, -1, side)
    asked = (view.known == 0) & (square - mean * mean > _LEAST_VARIANCE)
    inside = slice(_PATCH_RADIUS_PX, -_PATCH_RADIUS_PX, _STRIDE_PX)
    rows, columns = np.nonzero(asked[inside, inside])
    return np.stack([columns, rows], axis=1) * _STRIDE_PX + _PATCH_RADIUS_PX


def _homography(camera: Camera, other: Camera, row: np.ndarray) -> np.ndarray:
    """(3, 3) from pixels (x, y, 1) of ``camera`` to those of ``other`` times the ratio of their
    depths, through the plane of inverse depth ``row`` . (x, y, 1)."""
    relative = other.camera_from_world @ camera.world_from_camera
    return other.matrix @ (relative[:3, :3] @ np.linalg.inv(camera.matrix) + np.outer(relative[:3, 3], row))


@parallel_kernel
def _compare(grey, pixels, rows, bounds, onto, greys, known, like, beyond):
    """``_likeness_on`` for planes of inverse depth ``rows`` (D, 3) . (x, y, 1).

    ``bounds`` (B, 4): a . (x, y, 1) z + b >= 0 in the room; ``onto`` (D, O, 3, 3)."""
    for d in prange(rows.shape[0]):
        for i in range(pixels.shape[0]):
            x, y = pixels[i, 0] + 0.5, pixels[i, 1] + 0.5
            inverse = rows[d, 0] * x + rows[d, 1] * y + rows[d, 2]
            if not 1e-6 < inverse < 1.0 / _NEAREST_M:
                continue
            depth, inside = 1.0 / inverse, True
            for b in range(bounds.shape[0]):
                inside &= (bounds[b, 0] * x + bounds[b, 1] * y + bounds[b, 2]) * depth + bounds[b, 3] >= 0.0
            if not inside:
                continue
            for o in range(len(greys)):
                to = onto[d, o]
                reached = depth * (to[2, 0] * x + to[2, 1] * y + to[2, 2])
                if reached < _NEAREST_M:
                    continue
                u = depth * (to[0, 0] * x + to[0, 1] * y + to[0, 2]) / reached
                v = depth * (to[1, 0] * x + to[1, 1] * y + to[1, 2]) / reached
                height, width = known[o].shape
                if not (0.0 <= u < width and 0.0 <= v < height):
                    continue
                there = known[o][int(v), int(u)]
                if there > reached * (1.0 + FREE_MARGIN):
                    beyond[d, i] = True
                elif there == 0.0 or there > reached * (1.0 - FREE_MARGIN):
                    found = _likeness(grey, greys[o], to, pixels[i, 0], pixels[i, 1])
                    like[d, i] = max(like[d, i], found)


@inlined
def _likeness(grey, other, to, column, row):
    """Correlation of the patch of ``grey`` round a pixel and what ``to`` makes it show of
    ``other``; -2 where that leaves the image."""
    height, width = other.shape
    a, b, aa, bb, ab, count = 0.0, 0.0, 0.0, 0.0, 0.0, 0
    left = False
    for j in range(-_PATCH_RADIUS_PX, _PATCH_RADIUS_PX + 1, _PATCH_STEP_PX):
        for i in range(-_PATCH_RADIUS_PX, _PATCH_RADIUS_PX + 1, _PATCH_STEP_PX):
            x, y = column + i + 0.5, row + j + 0.5
            w = to[2, 0] * x + to[2, 1] * y + to[2, 2]
            u = (to[0, 0] * x + to[0, 1] * y + to[0, 2]) / w - 0.5
            v = (to[1, 0] * x + to[1, 1] * y + to[1, 2]) / w - 0.5
            if w <= 0.0 or not (0.0 <= u < width - 1 and 0.0 <= v < height - 1):
                left = True
                break
            m, n = int(u), int(v)
            s, t = u - m, v - n
            upper = other[n, m] * (1.0 - s) + other[n, m + 1] * s
            lower = other[n + 1, m] * (1.0 - s) + other[n + 1, m + 1] * s
            here, there = float(grey[row + j, column + i]), upper * (1.0 - t) + lower * t
            a, b, aa, bb, ab = a + here, b + there, aa + here * here, bb + there * there, ab + here * there
            count += 1
        if left:
            break
    result = -2.0
    if not left:
        variances = (aa / count - (a / count) ** 2, bb / count - (b / count) ** 2)
        noise = _LEAST_VARIANCE
        result = (ab / count - a * b / count**2) / np.sqrt(
            (max(variances[0], 0.0) + noise) * (max(variances[1], 0.0) + noise)
        )
    return result

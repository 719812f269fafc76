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

import numpy as np

from ...captures.capture import Capture
from ...captures.matching.plane_sweep import NEAREST_M, GreyView, likeness_on_planes, textured_pixels
from ...config.settings import Settings
from ...core.images import resize
from ..stereo.evidence import FREE_MARGIN, KnownDepth
from ..stereo.observed_geometry import ObservedGeometry
from ..stereo.stereo import DepthMap
from .completion import overlapping, trusted_depth
from .planes import RoomPlanes

_STEP_M = 0.02  # between offsets that are tried
_FINE_STEP_M = 0.005  # between those tried around the best of them
_MOST_OTHERS = 12  # captures that each is compared with
_SAME_SIDE = 0.9  # cosine between normals of bounds on the same side of the room
_SAME_DIRECTION = 0.98  # and between directions of which one need be tried
_ALIKE = 0.5  # correlation from which a pixel speaks for an offset, and below against it
_DISTINCT = 1.5  # times the evidence of any other peak, that of the best must be
_WIDEST_PEAK_M = 1.0  # a peak may be this wide where it has fallen by that factor
_LEAST_EVIDENCE = 10.0  # in pixels exactly alike; where there is no bound, hardly one is
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
        _view(*view) for view in zip(captures, depth_maps, trusted_depth(depth_maps, settings.stereo), strict=True)
    ]
    centres = np.array([view.camera.centre for view in views])
    compared = [(view, overlapping(index, views, _MOST_OTHERS)) for index, view in enumerate(views)]
    for normal in _directions(planes.envelope):
        if (planes.envelope.normals @ normal > _SAME_SIDE).any():
            continue
        nearest = min(
            np.quantile(points @ normal, 1 - settings.proxy.envelope_share), float((centres @ normal).min()) - NEAREST_M
        )
        extent = min(max(np.ptp(points @ normal), 1.0), _LARGEST_EXTENT_M)
        offset = _swept(compared, planes.envelope, normal, nearest + 2 * _STEP_M, extent)
        if offset is not None:
            planes = _with_bound(planes, normal, offset, points, settings.proxy.plane_tolerance_m)
    return planes


def _view(capture: Capture, depth_map: DepthMap, trusted: KnownDepth) -> GreyView:
    """A capture at the size of its depth map, with its trusted depth."""
    image = resize(capture.image(), depth_map.camera.width, depth_map.camera.height)
    return GreyView.of(image, trusted.camera, trusted.depth)


def _directions(envelope: RoomPlanes) -> list[np.ndarray]:
    """Inward normals that bounds may have: down, then against and square to the walls."""
    walls = envelope.normals[np.abs(envelope.normals[:, 2]) < 1e-6]
    square = np.stack([-walls[:, 1], walls[:, 0], walls[:, 2]], axis=1)
    directions = [np.array([0.0, 0.0, -1.0])]
    for normal in np.concatenate([-walls, square, -square]):
        if (np.array(directions) @ normal < _SAME_DIRECTION).all():
            directions.append(normal)
    return directions


_Compared = Sequence[tuple[GreyView, Sequence[GreyView]]]


def _with_bound(
    planes: RoomPlanes, normal: np.ndarray, offset: float, points: np.ndarray, tolerance_m: float
) -> RoomPlanes:
    on = int((np.abs(points @ normal - offset) < tolerance_m).sum())
    return planes.with_more(normal[None], np.array([offset]), np.array([on]), bounding=True)


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
    bounds = envelope.normals, envelope.offsets
    for view, others in compared:
        pixels = textured_pixels(view)
        if not others or not len(pixels):
            continue
        known, _ = likeness_on_planes(view, others, pixels, *bounds, bounds, FREE_MARGIN)
        like, beyond = likeness_on_planes(view, others, pixels, *candidates, bounds, FREE_MARGIN)
        gain = like - np.maximum(known.max(0, initial=-2.0), _ALIKE)
        counts = like > -2.0
        if same_pixels:
            counts &= counts.all(0)
        evidence += np.where(counts, gain, 0.0).sum(1) / (1.0 - _ALIKE)
        through += beyond.sum(1)
    return evidence, through

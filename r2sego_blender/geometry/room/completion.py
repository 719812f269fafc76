"""Completion of the captures' depth maps with the planes of the room.

Where stereo is unreliable (bare walls, a single view), each pixel chooses between the room's
planes by three kinds of evidence: how alike the captures look when warped by the plane's
homography, how well the plane agrees with reliable depth nearby (this capture's own and what
the others saw), and whether it stays clear of space the others saw to be free. The costs are
aggregated along the image's edges by a guided filter. Where no plane is sure, depth that two
captures agree on is taken although it matched badly; then a plane that convinces; then what is
known around goes on (``propagation``), or the envelope of the room where colours or the depth of
other captures speak for it; an estimator's depth takes the place of what is less sure than it.
Walls of the envelope behind which a capture sees recede for it (``niches``). Sparse points count
where stereo sees nothing, as evidence for planes, and planes through them are tried beside the
room's. What the colours of the other captures contradict then moves nearer, patch by patch
(``patch_depth``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from scipy import ndimage

from ...captures.capture import Capture
from ...captures.sparse_points import SparsePoints
from ...config.settings import Settings, StereoSettings
from ...core.cameras import Camera
from ...core.images import resize
from ...core.progress import SILENT, Progress
from ..estimators.aligned_depth import AlignedDepth, certainty_of
from ..estimators.aligning import is_carried
from ..stereo.edges import aligned_to_edges
from ..stereo.evidence import FREE_MARGIN, KnownDepth, collect_votes, seen_by_others
from ..stereo.stereo import DepthMap
from ..stereo.weak_depth import weak_depth
from .completed_depth import CompletedDepth, DepthSource
from .niches import receded
from .patch_depth import ColourView, more_alike, nearer_depth
from .planes import RoomPlanes
from .point_evidence import PointEvidence
from .propagation import propagated_depth
from .sparse_planes import with_sparse_planes

_OUTVOTED = 1.05  # how far neighbours of like colour must outvote a depth to replace it
_SURE_VOTES = 0.16  # share of a full window's votes that settles a depth at once
_PROBABLE_VOTES = 0.03  # share at which it is likelier than the bare envelope
_NCC_RADIUS_PX = 3
_GUIDE_RADIUS_PX = 9
_GUIDE_EPSILON = 1e-3
_PHOTO_WEIGHT = 0.5  # of the photometric cost, in [0, 1]
_AGREEMENT_WEIGHT = 0.8  # of the disagreement with reliable depth, in [0, 1]
_NO_EVIDENCE = 0.6  # the disagreement assumed where there is no reliable depth
_AGREEMENT_SCALE = 0.03  # relative depth difference of full disagreement
_CONTRADICTION = 0.5  # cost of each capture that saw through the plane
_OUT_OF_VIEW = 2.0  # cost of a plane that cannot be seen at a pixel
_CONVINCING = 1.0  # aggregated cost below which a plane is taken
_SURE = 0.7  # aggregated cost above which weak depth is likelier than a plane
# How far off completed depth is, relative, one sigma, where an estimate contradicts it: what is surer takes its place.
# Measured on the demo room and bare, furnished box rooms with true depth disturbed by 2 to 20 %: where an estimate this
# sure contradicts it, each is right as often (docs/estimated-depth.md).
_NEARBY_SIGMA, _PROBABLE_SIGMA = 0.03, 0.12
_AGREED_SIGMA = 0.25
_PLANE_SIGMA = 0.04  # at a cost of 1
_ENVELOPE_SIGMA = 0.15
_SIGMAS = 3.0  # of an estimate, within which it contradicts nothing
_CARRIED_SIGMAS = 1.0  # of one that carries its capture: the planes are made of it
_BEHIND_ENVELOPE_M = 0.05
_NEAREST_M = 0.3
_FARTHEST = 2.0
"""No plane is continued beyond this many times the farthest trusted depth of all captures: where
no wall ends a floor, it would go on to the horizon."""


def complete_depth(
    captures: Sequence[Capture],
    depth_maps: Sequence[DepthMap],
    planes: RoomPlanes,
    settings: Settings,
    progress: Progress = SILENT,
    estimates: Sequence[AlignedDepth] = (),
    sparse: SparsePoints | None = None,
) -> tuple[CompletedDepth, ...]:
    """Every capture's depth map, completed at the size of its stereo depth; ``estimates``, if any, one a capture
    at that size; ``sparse``, if any, the points that the captures measured."""
    sparse = sparse or SparsePoints.none(len(captures))
    planes = with_sparse_planes(planes, sparse, [capture.camera for capture in captures])
    trusted = trusted_depth(depth_maps, settings.stereo)
    weak = weak_depth(depth_maps, trusted, settings.stereo)
    views = [_View.of(*view) for view in zip(captures, depth_maps, trusted, weak, strict=True)]
    carrying = [one for one, view in zip(estimates, views, strict=False) if is_carried(view.known)]
    known = [*(view.known for view in views), *(one.depth for one in carrying)]
    farthest_m = _FARTHEST * max((float(depth.max()) for depth in known), default=0.0) or np.inf
    with progress.task("Completing depth", len(views)) as task:
        completed, bounds = [], []
        for index in range(len(views)):
            estimate = estimates[index] if estimates else None
            points = PointEvidence.of(views[index].camera, sparse.points[sparse.visibility[:, index]])
            found, bound = _completed(index, views, planes, points, farthest_m, settings, estimate)
            completed.append(found)
            bounds.append(bound)
            task.advance()
    return tuple(_unopposed(index, completed, bound) for index, bound in enumerate(bounds))


def trusted_depth(depth_maps: Sequence[DepthMap], settings: StereoSettings) -> tuple[KnownDepth, ...]:
    """The reliable depth of each map, less what other maps' reliable depth sees through.

    One witness against a pixel outweighs two that agree with it: textureless walls agree
    on wrong depth by chance, but hardly ever look through a surface that is there.
    """
    reliable = [KnownDepth(d.camera, np.where(d.reliable(settings), d.depth, 0).astype(np.float32)) for d in depth_maps]
    trusted = []
    for i, view in enumerate(reliable):
        seen = view.depth > 0
        points = view.camera.unproject(view.depth)[seen]
        votes = collect_votes(points, [v for j, v in enumerate(reliable) if j != i], FREE_MARGIN)
        depth = view.depth.copy()
        depth[seen] = np.where(2 * votes.through < np.maximum(votes.agree, 1), depth[seen], 0)
        trusted.append(KnownDepth(view.camera, depth))
    return tuple(trusted)


@dataclass(frozen=True)
class _View(ColourView):
    """A capture at the size of its depth map: ``known`` is its trusted depth aligned to the
    image's edges, 0 elsewhere; ``weak`` its weak depth elsewhere; ``likely`` what its
    surfaces nearby suggest, with ``votes``; ``measured`` what of ``known`` a sensor measured."""

    grey: np.ndarray
    weak: np.ndarray
    likely: np.ndarray
    votes: np.ndarray
    measured: np.ndarray

    @staticmethod
    def of(capture: Capture, depth_map: DepthMap, trusted: KnownDepth, weak: np.ndarray) -> _View:
        camera = trusted.camera
        image = resize(capture.image(), camera.width, camera.height)
        mode, votes, own = aligned_to_edges(image, trusted.depth, depth_map.normal, camera)
        fattened = (trusted.depth > 0) & (votes > _OUTVOTED * own)
        if depth_map.measured is not None:  # a sensor has no window to fatten things by
            fattened &= ~depth_map.measured
        known = np.where(fattened, mode, trusted.depth)
        measured = (known > 0) & depth_map.measured if depth_map.measured is not None else np.zeros(camera.shape, bool)
        return _View(camera, image, known, cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), weak, mode, votes, measured)


def _completed(
    index: int,
    views: Sequence[_View],
    planes: RoomPlanes,
    points: PointEvidence,
    farthest_m: float,
    settings: Settings,
    estimate: AlignedDepth | None,
) -> tuple[CompletedDepth, np.ndarray]:
    """The depth of view ``index``, and the (H, W) envelope's behind it, 0 where there is none."""
    view = views[index]
    overlapping_views = overlapping(index, views, settings.stereo.sources)
    others = [(other, *_depth_in(view.camera, other.camera)) for other in overlapping_views]
    moments = _moments(view.grey)
    planes, stays = receded(view.camera, points, planes)
    bound = _nearest(planes.envelope.depths(view.camera))
    stays[(bound > 0.0) & (bound < stays)] = 0.0
    bound = np.where(stays > 0.0, stays, bound)
    bound[bound > farthest_m] = 0.0
    last = np.where(bound > 0, bound + _BEHIND_ENVELOPE_M, farthest_m)
    elsewhere = [KnownDepth(other.camera, other.known) for j, other in enumerate(views) if j != index]
    anchor = _anchor(view, elsewhere)
    best_cost = np.full(view.camera.shape, np.inf, np.float32)
    best_depth = np.zeros(view.camera.shape, np.float32)
    for depth, row in zip(planes.depths(view.camera), planes.inverse_depth_rows(view.camera), strict=True):
        hidden = (depth < _NEAREST_M) | (depth > last)
        if hidden.all():
            continue
        cost = _plane_cost(view, moments, others, depth, row, anchor, points, estimate)
        cost[hidden] = _OUT_OF_VIEW
        cost = _guided(view.grey, cost) + 0.15 * cost
        better = (cost < best_cost) & ~hidden
        best_cost[better], best_depth[better] = cost[better], depth[better]
    observed = view.known > 0
    nearby = ~observed & (view.votes > _SURE_VOTES)
    agreed = ~observed & ~nearby & (view.weak > 0) & (best_cost > _SURE)
    on_plane = ~observed & ~nearby & ~agreed & (best_cost < _CONVINCING) & (best_depth > 0)
    nearby |= ~observed & ~agreed & ~on_plane & (view.votes > _PROBABLE_VOTES)
    on_envelope = ~observed & ~agreed & ~on_plane & ~nearby & (bound > 0)
    source = np.full(view.camera.shape, DepthSource.FILLED, np.uint8)
    depth = np.zeros(view.camera.shape, np.float32)
    for mask, values, kind in (
        (observed, view.known, DepthSource.OBSERVED),
        (agreed, view.weak, DepthSource.PLANE),
        (on_plane, best_depth, DepthSource.PLANE),
        (nearby, view.likely, DepthSource.PLANE),
        (on_envelope, bound, DepthSource.ENVELOPE),
    ):
        depth[mask], source[mask] = values[mask], kind
    source[view.measured] = DepthSource.MEASURED
    if estimate is not None:
        doubt = np.full(view.camera.shape, np.inf, np.float32)
        for mask, sigma in (
            (on_envelope, _ENVELOPE_SIGMA),
            (nearby, np.where(view.votes > _SURE_VOTES, _NEARBY_SIGMA, _PROBABLE_SIGMA)),
            (on_plane, _PLANE_SIGMA * np.maximum(best_cost, 0.0)),
            (agreed, _AGREED_SIGMA),
            (observed, 0.0),
        ):
            doubt[mask] = np.broadcast_to(sigma, doubt.shape)[mask]
        sigmas = _CARRIED_SIGMAS if is_carried(view.known) else _SIGMAS
        apart = np.abs(depth - estimate.depth) > sigmas * estimate.sigma * estimate.depth
        surer = (estimate.depth > 0) & (estimate.depth <= last) & apart & (estimate.sigma < doubt)
        depth[surer], source[surer] = estimate.depth[surer], DepthSource.ESTIMATED
    likely = np.isin(source, (DepthSource.ENVELOPE, DepthSource.FILLED))
    if likely.any():
        gone_on = propagated_depth(view, points, planes, last, elsewhere)
        likely &= (gone_on > 0) & (gone_on != bound) & (stays <= 0)
        likely &= ~more_alike(view, overlapping_views, likely & (bound > 0), bound, gone_on)
        depth[likely], source[likely] = gone_on[likely], DepthSource.FILLED
    depth = _filled(depth, observed)
    nearer = nearer_depth(view, overlapping_views, depth)
    moved = nearer > 0
    depth[moved], source[moved] = nearer[moved], DepthSource.PLANE
    if estimate is None:
        return CompletedDepth(depth, source, view.camera), bound
    certainty = np.where(source == DepthSource.ESTIMATED, certainty_of(estimate.sigma), np.float32(0.0))
    return CompletedDepth(depth, source, view.camera, certainty), bound


def _unopposed(index: int, completed: Sequence[CompletedDepth], bound: np.ndarray) -> CompletedDepth:
    """That of view ``index``, where what merely went on gives way to the ``bound`` (H, W) behind it if more of the
    others look through it than agree: what hangs before the room spoils pictures, what lies too far hardly does."""
    one = completed[index]
    opposed = (one.source == DepthSource.FILLED) & (bound > one.depth)
    others = [KnownDepth(other.camera, other.depth) for j, other in enumerate(completed) if j != index]
    votes = collect_votes(one.camera.unproject(one.depth)[opposed], others, FREE_MARGIN)
    opposed[opposed] = votes.through > votes.agree
    return replace(
        one,
        depth=np.where(opposed, bound, one.depth),
        source=np.where(opposed, np.uint8(DepthSource.ENVELOPE), one.source),
    )


def overlapping(index: int, views: Sequence[Any], count: int) -> list[Any]:
    """The ``count`` other views that see this one's trusted points best, nearest centre first on
    ties. Views have a ``camera`` and ``known`` (H, W) depth."""
    view = views[index]
    points = view.camera.unproject(view.known)[view.known > 0][::50]
    scores = []
    for j, other in enumerate(views):
        if j != index:
            seen = other.camera.sees(*other.camera.project(points)).mean() if len(points) else 0.0
            scores.append((-round(float(seen), 3), np.linalg.norm(other.camera.centre - view.camera.centre), j))
    return [views[j] for _, _, j in sorted(scores)[:count]]


def _nearest(depths: np.ndarray) -> np.ndarray:
    """The smallest positive depth over the first axis, 0 where there is none."""
    if not len(depths):
        return np.zeros(depths.shape[1:], np.float32)
    nearest = np.where(depths > 0, depths, np.inf).min(0)
    return np.where(np.isfinite(nearest), nearest, 0).astype(np.float32)


def _anchor(view: _View, others: Sequence[KnownDepth]) -> np.ndarray:
    """(H, W) reliable depth: the capture's own, else what the others saw, where visible here."""
    seen = seen_by_others(view.camera, others, view.known)
    return np.where(view.known > 0, view.known, seen).astype(np.float32)


def _plane_cost(
    view: _View,
    moments: tuple[np.ndarray, np.ndarray],
    others: Sequence[tuple[_View, np.ndarray, np.float32]],
    depth: np.ndarray,
    row: np.ndarray,
    anchor: np.ndarray,
    points: PointEvidence,
    estimate: AlignedDepth | None,
) -> np.ndarray:
    """(H, W) float32 evidence against one plane, 0 (certain) and up; ``others`` are views
    with what ``_depth_in`` says of them. Points around a pixel and an estimate count by their certainty where there
    is no ``anchor``."""
    width, height = view.camera.width, view.camera.height
    first = np.full((height, width), np.inf, np.float32)
    second = first.copy()
    contradictions = np.zeros((height, width), np.float32)
    mean, variance = moments
    outside = cv2.BORDER_CONSTANT
    linear = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    exact = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
    for other, slope, shift in others:
        homography = _homography(view.camera, other.camera, row)
        grey = cv2.warpPerspective(
            other.grey, homography, (width, height), flags=linear, borderMode=outside, borderValue=(-1,)
        )
        known = cv2.warpPerspective(
            other.known, homography, (width, height), flags=exact, borderMode=outside, borderValue=(0,)
        )
        reached = depth * slope + shift
        there = (grey >= 0) & (reached > 0)
        occluded = (known > 0) & (known < reached * (1 - FREE_MARGIN))
        contradictions += there & (known > reached * (1 + FREE_MARGIN))
        cost = 1 - _correlation(view.grey, mean, variance, np.maximum(grey, 0))
        cost = np.where(there & ~occluded, np.clip(cost, 0, 1), np.float32(np.inf))
        second = np.minimum(second, np.maximum(first, cost))
        first = np.minimum(first, cost)
    # One view alone counts a quarter more than it says, none as much as the worst match.
    photo = np.where(np.isfinite(second), (first + second) / 2, np.minimum(first + 0.25, 1))
    apart = np.abs(anchor - depth) / np.maximum(anchor, 1e-6) / _AGREEMENT_SCALE
    differing, sure = points.against(depth, _AGREEMENT_SCALE)
    agreement = np.where(anchor > 0, np.minimum(apart, 1), _NO_EVIDENCE + sure * (differing - _NO_EVIDENCE))
    if estimate is not None:
        off = np.abs(estimate.depth - depth) / np.maximum(estimate.depth, 1e-6)
        off /= np.maximum(_AGREEMENT_SCALE, 2.0 * estimate.sigma)
        told = _NO_EVIDENCE + certainty_of(estimate.sigma) * (np.minimum(off, 1) - _NO_EVIDENCE)
        agreement = np.where((anchor <= 0) & (estimate.depth > 0), told, agreement)
    cost = _PHOTO_WEIGHT * photo + _AGREEMENT_WEIGHT * agreement + _CONTRADICTION * contradictions
    return cost.astype(np.float32)


def _homography(camera: Camera, other: Camera, row: np.ndarray) -> np.ndarray:
    """(3, 3) from pixel indices of ``camera`` to those of ``other`` through the plane whose
    inverse depth is ``row`` . ray; OpenCV's pixel centres lie at integers."""
    relative = other.camera_from_world @ camera.world_from_camera
    through = relative[:3, :3] + np.outer(relative[:3, 3], row)
    shift = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1.0]])
    return np.linalg.inv(shift) @ other.matrix @ through @ np.linalg.inv(camera.matrix) @ shift


def _depth_in(camera: Camera, other: Camera) -> tuple[np.ndarray, np.float32]:
    """(H, W) float32 a and b: what lies at depth z in ``camera`` has depth a z + b in ``other``."""
    relative = other.camera_from_world @ camera.world_from_camera
    return (camera.rays() @ relative[2, :3]).astype(np.float32), np.float32(relative[2, 3])


def _box(image: np.ndarray, radius: int) -> np.ndarray:
    side = 2 * radius + 1
    return cv2.boxFilter(image, -1, (side, side), borderType=cv2.BORDER_REFLECT)


def _moments(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    mean = _box(image, _NCC_RADIUS_PX)
    return mean, np.maximum(_box(image * image, _NCC_RADIUS_PX) - mean * mean, 0)


def _correlation(image: np.ndarray, mean: np.ndarray, variance: np.ndarray, other: np.ndarray) -> np.ndarray:
    other_mean, other_variance = _moments(other)
    covariance = _box(image * other, _NCC_RADIUS_PX) - mean * other_mean
    noise = 4e-6  # grey-level variance of quantisation: bare patches correlate with nothing
    return covariance / np.sqrt((variance + noise) * (other_variance + noise))


def _guided(guide: np.ndarray, image: np.ndarray) -> np.ndarray:
    """The guided filter (He et al., 2010) of ``image`` along the edges of ``guide``."""
    mean_guide, mean = _box(guide, _GUIDE_RADIUS_PX), _box(image, _GUIDE_RADIUS_PX)
    covariance = _box(guide * image, _GUIDE_RADIUS_PX) - mean_guide * mean
    variance = _box(guide * guide, _GUIDE_RADIUS_PX) - mean_guide * mean_guide
    slope = covariance / (variance + _GUIDE_EPSILON)
    return _box(slope, _GUIDE_RADIUS_PX) * guide + _box(mean - slope * mean_guide, _GUIDE_RADIUS_PX)


def _filled(depth: np.ndarray, observed: np.ndarray) -> np.ndarray:
    """Holes closed with the nearest depth, and the completed part freed of single pixels."""
    if not (depth > 0).any():
        return depth
    nearest = ndimage.distance_transform_edt(depth <= 0, return_distances=False, return_indices=True)
    full = depth[tuple(nearest)]
    return np.where(observed, depth, cv2.medianBlur(full, 5))

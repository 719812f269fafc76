"""Completion of the captures' depth maps with the planes of the room.

Where stereo is unreliable (bare walls, a single view), each pixel chooses between the room's
planes by the evidence against each (``plane_evidence``). Where no plane is sure, depth that two
captures agree on is taken although it matched badly; then a plane that convinces; an estimator's
depth takes the place of what is less sure than it. When all captures have chosen, they are asked
for the rest one after another, those of most trusted depth first: what others were completed by is
taken where it shows, and what is known around goes on (``propagation``); or the envelope of the
room lies there, where colours or the depth of other captures speak for it.
Walls of the envelope behind which a capture sees recede for it (``niches``). Sparse points count
where stereo sees nothing, as evidence for planes, and planes through them are tried beside the
room's. What the colours of the other captures contradict then moves nearer, patch by patch
(``patch_depth``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import cv2
import numpy as np
from scipy import ndimage

from ...captures.capture import Capture
from ...captures.sparse_points import SparsePoints
from ...config.settings import Settings, StereoSettings
from ...core.images import resize
from ...core.progress import SILENT, Progress
from ...core.threads import in_threads_of_kernels
from ..estimators.aligned_depth import AlignedDepth, certainty_of
from ..estimators.aligning import is_carried
from ..stereo.edges import aligned_to_edges
from ..stereo.evidence import FREE_MARGIN, KnownDepth, collect_votes, seen_by_others
from ..stereo.stereo import DepthMap
from ..stereo.weak_depth import weak_depth
from .completed_depth import CompletedDepth, DepthSource
from .niches import receded
from .patch_depth import ColourView, more_alike, nearer_depth
from .plane_evidence import PlaneEvidence, guided_filter
from .planes import RoomPlanes
from .point_evidence import PointEvidence
from .propagation import propagated_depth
from .sparse_planes import with_sparse_planes

_OUTVOTED = 1.05  # how far neighbours of like colour must outvote a depth to replace it
_SURE_VOTES = 0.16  # share of a full window's votes that settles a depth at once
_PROBABLE_VOTES = 0.03  # share at which it is likelier than the bare envelope
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

_T = TypeVar("_T")


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
    carrying = [estimate for estimate, view in zip(estimates, views, strict=False) if is_carried(view.known)]
    known = [*(view.known for view in views), *(estimate.depth for estimate in carrying)]
    farthest_m = _FARTHEST * max((float(depth.max()) for depth in known), default=0.0) or np.inf

    def choose(index: int) -> _Chosen:
        estimate = estimates[index] if estimates else None
        points = PointEvidence.of(views[index].camera, sparse.points[sparse.visibility[:, index]])
        return _chosen(index, views, planes, points, farthest_m, settings, estimate)

    with progress.task("Completing depth", 2 * len(views)) as task:
        chosen = []
        for one in in_threads_of_kernels(choose, range(len(views))):
            chosen.append(one)
            task.advance()
        surfaces, found = [one.surfaces for one in chosen], {}
        for index in sorted(range(len(views)), key=lambda index: -np.count_nonzero(views[index].known)):
            found[index] = _continued(index, chosen, surfaces)
            surfaces[index] = _before_envelope(found[index])
            task.advance()
    completed = [found[index] for index in range(len(views))]
    return tuple(_unopposed(index, completed, one.bound) for index, one in enumerate(chosen))


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
        votes = collect_votes(points, _but(i, reliable), FREE_MARGIN)
        depth = view.depth.copy()
        depth[seen] = np.where(2 * votes.through < np.maximum(votes.agree, 1), depth[seen], 0)
        trusted.append(KnownDepth(view.camera, depth))
    return tuple(trusted)


@dataclass(frozen=True)
class _View(ColourView):
    """A capture at the size of its depth map: ``known`` is its trusted depth aligned to the
    image's edges, 0 elsewhere; ``weak`` its weak depth elsewhere; ``likely`` what its
    surfaces nearby suggest, with ``votes``; ``measured`` what of ``known`` a sensor measured."""

    weak: np.ndarray
    likely: np.ndarray
    votes: np.ndarray
    measured: np.ndarray

    @property
    def trusted(self) -> KnownDepth:
        """The trusted depth with its camera."""
        return KnownDepth(self.camera, self.known)

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
        return _View(camera, image, known, weak, mode, votes, measured)


@dataclass(frozen=True)
class _Chosen:
    """What the evidence chose for a ``view``: ``depth``, its ``source`` and the ``certainty`` of the estimate, if any;
    the envelope's depth ``bound`` behind it, 0 where there is none; ``last``, beyond which nothing lies; and where a
    wall ``stays`` though it recedes elsewhere (``niches``); all (H, W). ``sources`` are the views that see
    the same, ``planes`` and ``points`` the view's."""

    view: _View
    sources: Sequence[_View]
    depth: np.ndarray
    source: np.ndarray
    certainty: np.ndarray | None
    bound: np.ndarray
    last: np.ndarray
    stays: np.ndarray
    planes: RoomPlanes
    points: PointEvidence

    @property
    def surfaces(self) -> KnownDepth:
        """What the photographs spoke for: measured by them, or on one of the room's planes."""
        spoken_for = np.isin(self.source, (DepthSource.OBSERVED, DepthSource.MEASURED, DepthSource.PLANE))
        return KnownDepth(self.view.camera, np.where(spoken_for, self.depth, 0.0).astype(np.float32))


def _chosen(
    index: int,
    views: Sequence[_View],
    planes: RoomPlanes,
    points: PointEvidence,
    farthest_m: float,
    settings: Settings,
    estimate: AlignedDepth | None,
) -> _Chosen:
    """What the evidence chooses for view ``index``."""
    view = views[index]
    planes, stays = receded(view.camera, points, planes)
    bound = _nearest(planes.envelope.depths(view.camera))
    stays[(bound > 0.0) & (bound < stays)] = 0.0
    bound = np.where(stays > 0.0, stays, bound)
    bound[bound > farthest_m] = 0.0
    last = np.where(bound > 0, bound + _BEHIND_ENVELOPE_M, farthest_m)
    anchor = _anchor(view, [other.trusted for other in _but(index, views)])
    sources = overlapping(index, views, settings.stereo.sources)
    evidence = PlaneEvidence(view, sources, anchor, points, estimate)
    best_cost = np.full(view.camera.shape, np.inf, np.float32)
    best_depth = np.zeros(view.camera.shape, np.float32)
    for depth, row in zip(planes.depths(view.camera), planes.inverse_depth_rows(view.camera), strict=True):
        hidden = (depth < _NEAREST_M) | (depth > last)
        if hidden.all():
            continue
        cost = evidence.against(depth, row)
        cost[hidden] = _OUT_OF_VIEW
        cost = guided_filter(view.grey, cost) + 0.15 * cost
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
    certainty = None if estimate is None else certainty_of(estimate.sigma)
    return _Chosen(view, sources, depth, source, certainty, bound, last, stays, planes, points)


def _continued(index: int, chosen: Sequence[_Chosen], surfaces: Sequence[KnownDepth]) -> CompletedDepth:
    """The depth of view ``index``: where nothing was chosen for more than the envelope, the ``surfaces`` of the others
    that show there are taken as they are, and elsewhere what is known goes on."""
    one, view = chosen[index], chosen[index].view
    depth, source = one.depth.copy(), one.source.copy()
    likely = np.isin(source, (DepthSource.ENVELOPE, DepthSource.FILLED))
    if likely.any():
        seen = seen_by_others(view.camera, _but(index, surfaces), view.known)
        trusted = [other.view.trusted for other in _but(index, chosen)]
        gone_on = propagated_depth(view, one.points, seen, one.planes, one.last, trusted)
        gone_on = np.where((seen > 0) & (seen <= one.last), seen, gone_on)
        likely &= (gone_on > 0) & ((gone_on < one.bound) | (one.bound <= 0)) & (one.stays <= 0)
        likely &= ~more_alike(view, one.sources, likely & (one.bound > 0), one.bound, gone_on)
        depth[likely], source[likely] = gone_on[likely], DepthSource.FILLED
    depth = _filled(depth, view.known > 0)
    nearer = nearer_depth(view, one.sources, depth)
    moved = nearer > 0
    depth[moved], source[moved] = nearer[moved], DepthSource.PLANE
    if one.certainty is None:
        return CompletedDepth(depth, source, view.camera)
    certainty = np.where(source == DepthSource.ESTIMATED, one.certainty, np.float32(0.0))
    return CompletedDepth(depth, source, view.camera, certainty)


def _before_envelope(completed: CompletedDepth) -> KnownDepth:
    """What a view was completed by, less the envelope: behind it may be anything."""
    return KnownDepth(
        completed.camera, np.where(completed.source == DepthSource.ENVELOPE, np.float32(0.0), completed.depth)
    )


def _unopposed(index: int, completed: Sequence[CompletedDepth], bound: np.ndarray) -> CompletedDepth:
    """That of view ``index``, where what merely went on gives way to the ``bound`` (H, W) behind it if more of the
    others look through it than agree: what hangs before the room spoils pictures, what lies too far hardly does."""
    one = completed[index]
    opposed = (one.source == DepthSource.FILLED) & (bound > one.depth)
    others = [KnownDepth(other.camera, other.depth) for other in _but(index, completed)]
    votes = collect_votes(one.camera.unproject(one.depth)[opposed], others, FREE_MARGIN)
    opposed[opposed] = votes.through > votes.agree
    return replace(
        one,
        depth=np.where(opposed, bound, one.depth),
        source=np.where(opposed, np.uint8(DepthSource.ENVELOPE), one.source),
    )


def _but(index: int, each: Sequence[_T]) -> list[_T]:
    return [one for j, one in enumerate(each) if j != index]


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


def _filled(depth: np.ndarray, observed: np.ndarray) -> np.ndarray:
    """Holes closed with the nearest depth, and the completed part freed of single pixels."""
    if not (depth > 0).any():
        return depth
    nearest = ndimage.distance_transform_edt(depth <= 0, return_distances=False, return_indices=True)
    full = depth[tuple(nearest)]
    return np.where(observed, depth, cv2.medianBlur(full, 5))
